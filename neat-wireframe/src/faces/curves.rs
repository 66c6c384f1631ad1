//! The curves of a wireframe as boundaries of faces: straight edges, closed curves, and arcs and
//! splines whose ends are junctions.

use super::bounds::Bounds;
use super::chain::length_of_chain;
use super::face::{CurveIndex, Step};
use nalgebra::{Matrix3, Vector3};
use neat_core::{CircularArc, Dome, Spline, Wireframe3d};
use std::f64::consts::FRAC_PI_2;

/// Arcs are drawn in pieces that turn by so much, in radians.
pub(super) const TURN: f64 = 0.1;
/// Points of an arc that say in which plane it lies.
const POINTS_OF_ARC: usize = 8;
/// Standard deviation of a junction where none is known, and what is added to the known one, by
/// the extent of the wireframe: junctions of six solids that the assembler made lie 0.00001 to
/// 0.0003 off their planes (root mean square).
const JUNCTION_NOISE: f64 = 5e-4;
/// The same for points of arcs, whose own covariances are not asked: the radii of the two rims of
/// the toy's hole differ by 0.003.
const ARC_NOISE: f64 = 3e-3;
/// An end of an arc is a junction within so many standard deviations of an arc.
pub(super) const REACH: f64 = 4.0;

/// What is known of the wireframe, in one frame.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredGraph<'a> {
    /// Junctions and straight edges.
    pub wireframe: &'a Wireframe3d,
    /// Arcs beside them.
    pub arcs: &'a [CircularArc],
    /// Smooth curves beside them.
    pub splines: &'a [Spline],
    /// Parts of spheres that end at some of these circles, or touch round faces that do.
    pub domes: &'a [Dome],
    /// Covariances of the junctions; empty, or one for each, `None` where it is not determined.
    pub covariances: &'a [Option<Matrix3<f64>>],
}

impl<'a> MeasuredGraph<'a> {
    /// A wireframe of which nothing more is known.
    pub fn of(wireframe: &'a Wireframe3d) -> Self {
        Self {
            wireframe,
            arcs: &[],
            splines: &[],
            domes: &[],
            covariances: &[],
        }
    }
}

/// A curve that may bound faces.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub index: CurveIndex,
    /// The junctions at its start and end; `None` if it is closed.
    pub ends: Option<[usize; 2]>,
    /// Points along it, the ends among them; the first and last of a closed one are the same.
    pub points: Vec<Vector3<f64>>,
    /// Points by which its plane is known, each with its covariance.
    pub measured: Vec<(Vector3<f64>, Matrix3<f64>)>,
    /// The arc, if it is one.
    pub arc: Option<CircularArc>,
}

/// The curves of a wireframe, with its size and noise.
pub(super) struct Curves {
    /// Those that may bound faces, ascending.
    pub all: Vec<Curve>,
    /// Arcs and splines that may not, as an end is no junction.
    pub loose: Vec<Vec<Vector3<f64>>>,
    /// Greatest side of the box around the wireframe.
    pub extent: f64,
}

impl Curve {
    /// Whether it is an edge or an inferred line.
    pub fn is_straight(&self) -> bool {
        matches!(self.index, CurveIndex::Edge(_) | CurveIndex::Smooth(_))
    }

    pub fn length(&self) -> f64 {
        length_of_chain(&self.points)
    }

    /// The points in the direction of a loop.
    pub fn points_along(&self, step: &Step) -> Vec<Vector3<f64>> {
        let mut points = self.points.clone();
        if step.reversed {
            points.reverse();
        }
        points
    }
}

impl Curves {
    pub fn new(graph: &MeasuredGraph) -> Self {
        let extent = extent(graph);
        let floor = |share: f64| Matrix3::identity() * (share * extent).powi(2);
        let junctions = &graph.wireframe.junctions;
        let covariance = |junction: usize| {
            let known = graph.covariances.get(junction).copied().flatten();
            known.unwrap_or_default() + floor(JUNCTION_NOISE)
        };
        let edge = |(index, ends): (usize, &[usize; 2])| Curve {
            index: CurveIndex::Edge(index),
            ends: Some(*ends),
            points: ends.map(|end| junctions[end]).to_vec(),
            measured: ends.map(|end| (junctions[end], covariance(end))).to_vec(),
            arc: None,
        };
        let has_length = |curve: &Curve| curve.points[0] != curve.points[1];
        let edges = graph.wireframe.edges.iter().enumerate().map(edge);
        let mut all: Vec<Curve> = edges.filter(has_length).collect();
        let mut loose = Vec::new();
        let mut add = |index: CurveIndex, mut points: Vec<Vector3<f64>>, of: Curved| {
            let ends = of.ends.and_then(|ends| {
                let reach = REACH * ARC_NOISE * extent;
                junctions_at(ends, junctions, reach)
            });
            match (of.ends, ends) {
                (Some(_), None) => return loose.push(points),
                (_, Some([start, end])) => {
                    let last = points.len() - 1;
                    (points[0], points[last]) = (junctions[start], junctions[end]);
                }
                (None, None) => {}
            }
            let measured = of.measured.into_iter();
            all.push(Curve {
                index,
                ends,
                points,
                measured: measured.map(|point| (point, floor(ARC_NOISE))).collect(),
                arc: of.arc,
            });
        };
        for (index, arc) in graph.arcs.iter().enumerate() {
            let of = Curved {
                ends: (!arc.is_closed()).then(|| ends_of_arc(arc)),
                measured: measured_points(arc).collect(),
                arc: Some(*arc),
            };
            add(CurveIndex::Arc(index), arc.points(TURN), of);
        }
        for (index, spline) in graph.splines.iter().enumerate() {
            let points = spline.points(TURN);
            let of = Curved {
                ends: (!spline.closed).then(|| ends_of_spline(spline)),
                measured: points.clone(),
                arc: None,
            };
            add(CurveIndex::Spline(index), points, of);
        }
        Self { all, loose, extent }
    }

    /// The same with curves that are inferred from them.
    pub fn with_inferred(mut self, lines: Vec<Curve>) -> Self {
        self.all.extend(lines);
        self.all.sort_by_key(|curve| curve.index);
        self.all.dedup_by_key(|curve| curve.index);
        self
    }

    /// Those that images show.
    pub fn observed(&self) -> impl Iterator<Item = &Curve> {
        self.all.iter().filter(|curve| !curve.index.is_inferred())
    }

    /// The place of a curve in [`Curves::all`].
    pub fn find(&self, index: CurveIndex) -> Option<&Curve> {
        let found = self.all.binary_search_by_key(&index, |curve| curve.index);
        found.ok().map(|found| &self.all[found])
    }

    /// The points along a step of a loop; none of a curve that is not among them.
    pub fn points_along(&self, step: &Step) -> Vec<Vector3<f64>> {
        let curve = self.find(step.curve);
        curve.map_or_else(Vec::new, |curve| curve.points_along(step))
    }

    /// What is added to the covariances of junctions.
    pub fn junction_floor(&self) -> Matrix3<f64> {
        Matrix3::identity() * self.junction_sigma().powi(2)
    }

    /// Standard deviation that is added to those of junctions.
    pub fn junction_sigma(&self) -> f64 {
        JUNCTION_NOISE * self.extent
    }

    /// Covariance of a point of an arc.
    pub fn arc_covariance(&self) -> Matrix3<f64> {
        Matrix3::identity() * self.arc_sigma().powi(2)
    }

    /// Standard deviation of a point of an arc.
    pub fn arc_sigma(&self) -> f64 {
        ARC_NOISE * self.extent
    }
}

/// Two junctions, the lower first.
pub(super) fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// What is known of an arc or a spline, but for its index.
struct Curved {
    /// Where it begins and ends; `None` if it is closed.
    ends: Option<[Vector3<f64>; 2]>,
    /// Points by which its plane is known.
    measured: Vec<Vector3<f64>>,
    arc: Option<CircularArc>,
}

/// The points of an arc that say where it lies.
pub(super) fn measured_points(arc: &CircularArc) -> impl Iterator<Item = Vector3<f64>> {
    let angle = |k: usize| arc.angles[0] + arc.sweep() * k as f64 / POINTS_OF_ARC as f64;
    (0..POINTS_OF_ARC).map(move |k| arc.point_at(angle(k)))
}

/// Where an arc begins and ends.
pub(crate) fn ends_of_arc(arc: &CircularArc) -> [Vector3<f64>; 2] {
    arc.angles.map(|angle| arc.point_at(angle))
}

/// Where an open spline begins and ends.
pub(crate) fn ends_of_spline(spline: &Spline) -> [Vector3<f64>; 2] {
    [0, spline.controls.len() - 1].map(|end| spline.controls[end])
}

/// The junctions nearest to two ends; `None` without junctions.
pub(crate) fn nearest_junctions(
    ends: [Vector3<f64>; 2],
    junctions: &[Vector3<f64>],
) -> Option<[usize; 2]> {
    let nearest = |point: Vector3<f64>| {
        let distances = junctions.iter().map(|j| (j - point).norm()).enumerate();
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(nearest.0)
    };
    Some([nearest(ends[0])?, nearest(ends[1])?])
}

/// The junctions at two ends, if both are near one, and not the same.
fn junctions_at(
    ends: [Vector3<f64>; 2],
    junctions: &[Vector3<f64>],
    reach: f64,
) -> Option<[usize; 2]> {
    let nearest = nearest_junctions(ends, junctions)?;
    let near = |k: usize| (junctions[nearest[k]] - ends[k]).norm() <= reach;
    (nearest[0] != nearest[1] && near(0) && near(1)).then_some(nearest)
}

fn extent(graph: &MeasuredGraph) -> f64 {
    let of_arcs = graph.arcs.iter().flat_map(|arc| arc.points(TURN));
    let of_splines = graph.splines.iter().flat_map(|spline| spline.points(TURN));
    // As wide as its sphere, if it goes beyond half of that.
    let of_domes = graph.domes.iter().flat_map(|dome| {
        let reach = dome.reach.min(FRAC_PI_2);
        let widest = Dome { reach, ..*dome }.rim().points(TURN);
        let pole = dome.center + dome.radius * dome.axis;
        widest
            .into_iter()
            .chain([pole])
            .chain(dome.rim().points(TURN))
    });
    let of_curves: Vec<Vector3<f64>> = of_arcs.chain(of_splines).chain(of_domes).collect();
    let bounds = Bounds::of(graph.wireframe.junctions.iter().chain(&of_curves));
    // There may be nothing.
    bounds.extent().max(0.0)
}
