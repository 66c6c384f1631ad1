//! Dimensions of a wireframe, each with its standard deviation: lengths of edges, distances
//! of junctions and of parallel edges, angles, radii of arcs and the spacing of their centres, and
//! areas of faces.
//!
//! A dimension is a function of a few places, such as positions of junctions, and of those that
//! set the scale. Its variance is linear propagation of their covariances as `wireframe.json` has
//! them. Places count as independent of each other, but for the centre and the radius of one arc, and
//! one that a dimension uses twice, such as an end of the edge that sets the scale, counts as one.
//!
//! ```
//! use neat_wireframe::dimensions::{Dimensions, Quantity};
//! use neat_wireframe::export::WireframeDocument;
//!
//! let document = WireframeDocument {
//!     junctions: vec![[0.0, 0.0, 0.0].into(), [2.0, 0.0, 0.0].into()],
//!     edges: vec![[0, 1]],
//!     junction_covariances: vec![Some([1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4]); 2],
//!     ..Default::default()
//! };
//! let scale = "0-1=3.20m".parse()?;
//! let dimensions = Dimensions::new(&document, Some(scale))?;
//! let length = dimensions.measure(Quantity::Length { edge: 0 })?;
//! // What sets the scale is known as well as its measure is.
//! assert!((length.value - 3.2).abs() < 1e-12 && length.sigma.unwrap() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod area;
mod geometry;
mod parallel;
mod scale;

pub use scale::{Scale, ScaleError};

use crate::export::WireframeDocument;
use crate::faces::Face;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Half the width of a 95 % interval of one normal number, in standard deviations …
const INTERVAL: f64 = 1.959_964;
/// … and the radius of the disc that holds 95 % of two.
const DISC: f64 = 2.447_747;
/// Step of the derivatives, as a share of the greatest extent: differences are exact to about
/// 1e-10 of it.
const STEP: f64 = 1e-6;
/// Edges under a smaller sine to each other leave in the same direction, or the opposite one.
const SAME_DIRECTION: f64 = 0.1;

/// What is measured, by the numbers that `wireframe.json` counts from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Quantity {
    /// From one end of an edge to the other.
    Length {
        /// The edge.
        edge: usize,
    },
    /// Between two junctions.
    Distance {
        /// The junctions.
        junctions: [usize; 2],
    },
    /// From the middle of the shorter of two edges to the line of the other.
    Gap {
        /// The edges.
        edges: [usize; 2],
    },
    /// Between the lines of two edges, from 0 to 90°.
    Angle {
        /// The edges.
        edges: [usize; 2],
    },
    /// Of the circle of an arc.
    Radius {
        /// The arc.
        arc: usize,
    },
    /// Between the centres of two arcs.
    Spacing {
        /// The arcs.
        arcs: [usize; 2],
    },
    /// Of a face, less its holes.
    Area {
        /// The face, counted through all shells.
        face: usize,
    },
}

/// What a quantity depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Junction(usize),
    Center(usize),
    /// The first coordinate is the radius.
    Radius(usize),
    /// A control point of a spline.
    Control(usize, usize),
    /// A sphere: that it is there says nothing of how sure it is.
    Sphere,
}

/// A quantity with its value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dimension {
    /// What it is.
    #[serde(flatten)]
    pub quantity: Quantity,
    /// In degrees for angles, else in the unit of [`Dimensions::unit`], areas in its square.
    pub value: f64,
    /// Its standard deviation, in the same unit; `None` where a junction is not determined.
    pub sigma: Option<f64>,
    /// Holds the true value with a probability of 95 %, as far as the covariances hold.
    pub interval: Option<[f64; 2]>,
    /// Whether it hangs on an end of an edge that no edge of another direction fixes.
    pub free_end: bool,
}

/// Why something cannot be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DimensionError {
    /// A number beyond the last.
    #[error("there is no {what} {index}: the wireframe has {count}, counted from 0")]
    Missing {
        /// "junction", "edge", "arc" or "face".
        what: &'static str,
        /// The number asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// One thing, twice.
    #[error("{what} {index} is named twice: name two of them")]
    Twice {
        /// "junction", "edge" or "arc".
        what: &'static str,
        /// Its number.
        index: usize,
    },
    /// Junctions in one place set no scale, and an edge between them has no direction.
    #[error("junctions {a} and {b} lie in one place: choose others")]
    OnePlace {
        /// One of them.
        a: usize,
        /// The other.
        b: usize,
    },
}

/// Measures the wireframe of a document.
pub struct Dimensions<'a> {
    document: &'a WireframeDocument,
    scale: Option<Scale>,
    /// Greatest side of the box around all junctions and centres, or the greatest radius.
    extent: f64,
    /// Whether each junction is a free end.
    free: Vec<bool>,
}

impl<'a> Dimensions<'a> {
    /// - `document`: one that passes [`WireframeDocument::check`].
    /// - `scale`: what a distance truly is; without, lengths are in the unit of the files.
    ///
    /// # Errors
    /// If the scale names junctions that are not there or lie in one place.
    pub fn new(
        document: &'a WireframeDocument,
        scale: Option<Scale>,
    ) -> Result<Self, DimensionError> {
        let centers = document.arcs.iter().map(|arc| &arc.center);
        let axes = (document.junctions.iter().chain(centers)).flat_map(|p| [p.x, p.y, p.z]);
        let largest = axes.clone().fold(f64::NEG_INFINITY, f64::max);
        let extent = largest - axes.fold(f64::INFINITY, f64::min);
        let radii = document.arcs.iter().map(|arc| arc.radius);
        let dimensions = Self {
            document,
            scale,
            extent: radii.fold(extent.max(f64::MIN_POSITIVE), f64::max),
            free: free_ends(document),
        };
        if let Some(scale) = &scale {
            dimensions.check(&Quantity::Distance {
                junctions: scale.junctions,
            })?;
        }
        Ok(dimensions)
    }

    /// The unit of lengths; `None` is that of the files.
    pub fn unit(&self) -> Option<&'static str> {
        self.scale.map(|scale| scale.unit)
    }

    /// The lengths of all edges, in their order. Edges without a length are left out.
    pub fn lengths(&self) -> Vec<Dimension> {
        (0..self.document.edges.len())
            .filter_map(|edge| self.measure(Quantity::Length { edge }).ok())
            .collect()
    }

    /// The radii of all arcs, in their order.
    pub fn radii(&self) -> Vec<Dimension> {
        (0..self.document.arcs.len())
            .filter_map(|arc| self.measure(Quantity::Radius { arc }).ok())
            .collect()
    }

    /// The areas of all faces, in their order.
    pub fn areas(&self) -> Vec<Dimension> {
        let count = face_count(self.document);
        (0..count)
            .filter_map(|face| self.measure(Quantity::Area { face }).ok())
            .collect()
    }

    /// The gaps between edges that may be parallel, lie beside each other for most of the
    /// shorter one and apart for sure; those of the longest edges first, `most` at most.
    pub fn parallels(&self, most: usize) -> Vec<Dimension> {
        parallel::pairs(self, most)
    }

    /// The value of one quantity, and how sure it is.
    ///
    /// # Errors
    /// If it names what is not there, one thing twice, or an edge without a direction.
    pub fn measure(&self, quantity: Quantity) -> Result<Dimension, DimensionError> {
        self.check(&quantity)?;
        let own = self.places_of(&quantity);
        let by_scale = match quantity {
            Quantity::Angle { .. } => None,
            _ => self.scale,
        };
        let mut places = own.clone();
        let reference = by_scale.iter().flat_map(|scale| scale.junctions);
        places.extend(reference.map(Place::Junction));
        let face = self.face_of(&quantity);
        // How often a length is in it.
        let power = if face.is_some() { 2 } else { 1 };
        let value = |points: &[Vector3<f64>]| {
            let (own, reference) = points.split_at(own.len());
            let value = match face {
                Some(face) => area::value(self.document, face, own),
                None => geometry::value(&quantity, own),
            };
            match (by_scale, reference) {
                (Some(scale), [a, b]) => value * (scale.length / (b - a).norm()).powi(power),
                _ => value,
            }
        };
        let points: Vec<Vector3<f64>> = (places.iter().map(|place| self.point(*place))).collect();
        let measured = value(&points);
        let propagated =
            |of: &dyn Fn(&[Vector3<f64>]) -> Vector3<f64>| self.propagated(&places, &points, of);
        let linear = || propagated(&|points| Vector3::new(value(points), 0.0, 0.0));
        let variance = match quantity {
            // An angle near 0 has no derivative: it is how far apart two directions are.
            Quantity::Angle { .. } => match propagated(&geometry::apart) {
                Some(variance) if measured > DISC * variance.sqrt() => linear(),
                variance => variance,
            },
            _ => linear(),
        };
        let relative = by_scale.map_or(0.0, |scale| f64::from(power) * scale.sigma / scale.length);
        let sigma = variance.map(|variance| (variance + (measured * relative).powi(2)).sqrt());
        Ok(Dimension {
            quantity,
            value: measured,
            sigma,
            interval: sigma.map(|sigma| interval(&quantity, measured, sigma)),
            free_end: match quantity {
                Quantity::Length { .. } | Quantity::Distance { .. } => (places.iter())
                    .any(|place| matches!(place, Place::Junction(j) if self.free[*j])),
                _ => false,
            },
        })
    }

    /// The largest variance of a vector in any direction, by linear propagation, with central
    /// differences for derivatives; `None` if a place is not determined.
    fn propagated(
        &self,
        places: &[Place],
        points: &[Vector3<f64>],
        of: &dyn Fn(&[Vector3<f64>]) -> Vector3<f64>,
    ) -> Option<f64> {
        // Slopes cost more than it takes to see that they are of no use.
        if places.iter().any(|place| self.covariance(*place).is_none()) {
            return None;
        }
        let step = STEP * self.extent;
        let mut sum = Matrix3::zeros();
        let mut slopes_of_centers = BTreeMap::new();
        for place in places.iter().copied().collect::<BTreeSet<Place>>() {
            // It moves wherever it stands.
            let moved = |by: Vector3<f64>| {
                let all = places.iter().zip(points);
                let all = all.map(|(other, p)| if *other == place { p + by } else { *p });
                of(&all.collect::<Vec<_>>())
            };
            let slopes = [Vector3::x(), Vector3::y(), Vector3::z()]
                .map(|axis| (moved(axis * step) - moved(-axis * step)) / (2.0 * step));
            let slopes = Matrix3::from_columns(&slopes);
            sum += slopes * self.covariance(place)? * slopes.transpose();
            // Centres come before radii.
            match place {
                Place::Center(arc) => {
                    slopes_of_centers.insert(arc, slopes);
                }
                Place::Radius(arc) => {
                    if let Some(of_center) = slopes_of_centers.get(&arc) {
                        let with_radius = self.covariance_of_center_and_radius(arc)?;
                        let both = of_center * with_radius * slopes.column(0).transpose();
                        sum += both + both.transpose();
                    }
                }
                Place::Junction(_) | Place::Control(..) | Place::Sphere => {}
            }
        }
        let finite = sum.iter().all(|x| x.is_finite());
        finite.then(|| sum.symmetric_eigenvalues().max().max(0.0))
    }

    /// The face of which a quantity is the area, counted through all shells.
    fn face_of(&self, quantity: &Quantity) -> Option<&Face> {
        let Quantity::Area { face } = quantity else {
            return None;
        };
        let mut faces = self.document.shells.iter().flat_map(|shell| &shell.faces);
        faces.nth(*face)
    }

    fn point(&self, place: Place) -> Vector3<f64> {
        match place {
            Place::Junction(junction) => self.document.junctions[junction],
            Place::Center(arc) => self.document.arcs[arc].center,
            Place::Radius(arc) => Vector3::x() * self.document.arcs[arc].radius,
            Place::Control(spline, control) => self.document.splines[spline].controls[control],
            Place::Sphere => Vector3::zeros(),
        }
    }

    fn covariance(&self, place: Place) -> Option<Matrix3<f64>> {
        let of_arc = |arc: usize| *self.document.arc_covariances.get(arc)?;
        let [xx, xy, xz, yy, yz, zz] = match place {
            Place::Junction(junction) => (*self.document.junction_covariances.get(junction)?)?,
            Place::Center(arc) => {
                let [xx, xy, xz, _, yy, yz, _, zz, ..] = of_arc(arc)?;
                [xx, xy, xz, yy, yz, zz]
            }
            Place::Radius(arc) => [of_arc(arc)?[9], 0.0, 0.0, 0.0, 0.0, 0.0],
            // Nobody has asked the views how sure they are.
            Place::Control(..) | Place::Sphere => return None,
        };
        Some(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz))
    }

    /// Of each coordinate of the centre with the radius.
    fn covariance_of_center_and_radius(&self, arc: usize) -> Option<Vector3<f64>> {
        let [_, _, _, x, _, _, y, _, z, _] = (*self.document.arc_covariances.get(arc)?)?;
        Some(Vector3::new(x, y, z))
    }

    /// In the order that [`geometry::value`] and [`area::value`] expect.
    fn places_of(&self, quantity: &Quantity) -> Vec<Place> {
        let ends = |edges: &[usize]| {
            let ends = edges.iter().flat_map(|edge| self.document.edges[*edge]);
            ends.map(Place::Junction).collect()
        };
        match quantity {
            Quantity::Length { edge } => ends(&[*edge]),
            Quantity::Distance { junctions } => junctions.map(Place::Junction).to_vec(),
            Quantity::Gap { edges } | Quantity::Angle { edges } => ends(edges),
            Quantity::Radius { arc } => vec![Place::Radius(*arc)],
            Quantity::Spacing { arcs } => arcs.map(Place::Center).to_vec(),
            Quantity::Area { .. } => match self.face_of(quantity) {
                Some(face) => area::places(self.document, face),
                None => Vec::new(),
            },
        }
    }

    fn check(&self, quantity: &Quantity) -> Result<(), DimensionError> {
        let document = self.document;
        let (what, named, count) = match quantity {
            Quantity::Length { edge } => ("edge", vec![*edge], document.edges.len()),
            Quantity::Distance { junctions } => {
                ("junction", junctions.to_vec(), document.junctions.len())
            }
            Quantity::Gap { edges } | Quantity::Angle { edges } => {
                ("edge", edges.to_vec(), document.edges.len())
            }
            Quantity::Radius { arc } => ("arc", vec![*arc], document.arcs.len()),
            Quantity::Spacing { arcs } => ("arc", arcs.to_vec(), document.arcs.len()),
            Quantity::Area { face } => ("face", vec![*face], face_count(document)),
        };
        if let Some(&index) = named.iter().find(|index| **index >= count) {
            return Err(DimensionError::Missing { what, index, count });
        }
        if let [index, other] = named[..]
            && index == other
        {
            return Err(DimensionError::Twice { what, index });
        }
        // Of what an area hangs on places do not come in pairs.
        let is_area = matches!(quantity, Quantity::Area { .. });
        let places = if is_area {
            Vec::new()
        } else {
            self.places_of(quantity)
        };
        for pair in places.chunks_exact(2) {
            let [Place::Junction(a), Place::Junction(b)] = [pair[0], pair[1]] else {
                continue;
            };
            let apart = (self.document.junctions[b] - self.document.junctions[a]).norm();
            if apart <= 2.0 * STEP * self.extent {
                return Err(DimensionError::OnePlace { a, b });
            }
        }
        Ok(())
    }
}

fn face_count(document: &WireframeDocument) -> usize {
    document.shells.iter().map(|shell| shell.faces.len()).sum()
}

/// Lengths and areas are not negative, and angles end at 0 and 90°. There a small angle is no normal
/// number: it is the length of two, and grows by noise alone.
fn interval(quantity: &Quantity, value: f64, sigma: f64) -> [f64; 2] {
    let around = [value - INTERVAL * sigma, value + INTERVAL * sigma];
    match quantity {
        Quantity::Angle { .. } if value <= DISC * sigma => [0.0, (value + DISC * sigma).min(90.0)],
        Quantity::Angle { .. } => [around[0], around[1].min(90.0)],
        _ => [around[0].max(0.0), around[1]],
    }
}

/// The junctions at which no two edges of different directions meet: where such an edge ends
/// along itself, no other tells.
fn free_ends(document: &WireframeDocument) -> Vec<bool> {
    let mut directions: Vec<Vec<Vector3<f64>>> = vec![Vec::new(); document.junctions.len()];
    for [a, b] in &document.edges {
        let along = document.junctions[*b] - document.junctions[*a];
        if let Some(along) = along.try_normalize(0.0) {
            directions[*a].push(along);
            directions[*b].push(along);
        }
    }
    let is_free = |directions: &Vec<Vector3<f64>>| {
        let mut others = directions.iter().skip(1);
        !others.any(|other| directions[0].cross(other).norm() > SAME_DIRECTION)
    };
    directions.iter().map(is_free).collect()
}

#[cfg(test)]
mod tests;
