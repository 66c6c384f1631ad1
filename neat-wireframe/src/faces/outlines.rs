//! What images say about the round faces of solids by their outlines: straight lines along rulings at
//! which the surface turns away from the camera. They are no curves of the wireframe.
//!
//! Two circles are the rims of a cylinder or a cone, or of something else: where nothing else of a
//! solid hides the outlines of such a face, they are shown, each with a probability of [`SHOWN`]; if it
//! is none, by chance.

use super::chain::point_along;
use super::curves::Curves;
use super::face::{CurveIndex, Face, Shell};
use super::region::Region;
use super::selection::MOST_AGAINST;
use super::surface::Surface;
use super::unrolled::{self, Chain, Unrolled};
use super::visibility::{BY_CHANCE, STEP, is_shown};
use crate::ViewObservation;
use crate::projection::project_in_front;
use crate::segment_grid::SegmentGrid;
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, LineSegment2};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Probability that 2D segments lie along an outline that is seen: the median of 31 cylinders and cones
/// of solids on parts is .85, the least .5, and of two cones that are none it is 0 of 216.
const SHOWN: f64 = 0.8;
/// Points along an outline that are asked for …
const SAMPLES: usize = 16;
/// … and how many of them have to be in the image and hidden by no face, so that it is.
const MIN_SAMPLES: usize = 8;

/// One view with its segments.
struct OutlineView {
    camera: Camera,
    segments: Vec<LineSegment2>,
    grid: SegmentGrid,
}

/// The views that may show outlines.
pub(super) struct Outlines {
    views: Vec<OutlineView>,
}

impl Outlines {
    pub fn new(views: &[ViewObservation]) -> Self {
        let usable = views
            .par_iter()
            .filter(|view| view.camera.validate().is_ok());
        let views = usable.map(|view| {
            let segments: Vec<LineSegment2> = view.segments.iter().map(|s| s.segment).collect();
            let (width, height) = (view.camera.width, view.camera.height);
            OutlineView {
                camera: view.camera,
                grid: SegmentGrid::new(&segments, width, height),
                segments,
            }
        });
        Self {
            views: views.collect(),
        }
    }

    /// The boundaries of faces of solids whose outlines images do not show.
    pub fn unseen(&self, curves: &Curves, shells: &[Shell]) -> BTreeSet<Vec<CurveIndex>> {
        let mut unseen = BTreeSet::new();
        let faces: Vec<(&Shell, &Face)> = (shells.iter())
            .flat_map(|shell| shell.faces.iter().map(move |face| (shell, face)))
            .collect();
        let regions: Vec<Option<Region>> = (faces.par_iter())
            .map(|(_, face)| Region::new(curves, face))
            .collect();
        for (place, (shell, face)) in faces.iter().enumerate() {
            let (true, Some(region)) = (shell.closed, &regions[place]) else {
                continue;
            };
            // Other things may be in front, too.
            let others = regions.iter().enumerate();
            let others = others.filter(|(other, _)| *other != place);
            let others: Vec<&Region> = others.filter_map(|(_, other)| other.as_ref()).collect();
            let [shown, asked] = self.shown(face, region, &others);
            let hidden = asked - shown;
            let against = hidden as f64 * ((1.0 - BY_CHANCE) / (1.0 - SHOWN)).ln()
                - shown as f64 * (SHOWN / BY_CHANCE).ln();
            if against > MOST_AGAINST {
                unseen.insert(face.boundary());
            }
        }
        unseen
    }

    /// How many outlines of a face images show, of those that no other face hides; none of a face that
    /// is not round, or not convex.
    fn shown(&self, face: &Face, region: &Region, others: &[&Region]) -> [usize; 2] {
        let (Surface::Cylinder { convex: true, .. } | Surface::Cone { convex: true, .. }) =
            face.surface
        else {
            return [0, 0];
        };
        let Region::Round { surface, loops } = region else {
            return [0, 0];
        };
        let counts = self.views.par_iter().map(|view| {
            let outlines = outlines(surface, loops, &view.camera.center_in_world);
            let seen = outlines
                .iter()
                .filter_map(|outline| view.shows(outline, others));
            let seen: Vec<bool> = seen.collect();
            [seen.iter().filter(|shown| **shown).count(), seen.len()]
        });
        counts.reduce(|| [0, 0], |a, b| [a[0] + b[0], a[1] + b[1]])
    }
}

/// The outlines of a round face as seen from a point.
fn outlines(surface: &Unrolled, loops: &[Chain], center: &Vector3<f64>) -> Vec<[Vector3<f64>; 2]> {
    let pieces = surface
        .outline_angles(center)
        .into_iter()
        .flatten()
        .flat_map(|angle| {
            let heights = unrolled::crossings(loops, angle);
            let point = move |height: f64| surface.point(&Vector2::new(angle, height));
            let pieces: Vec<_> = (heights.chunks_exact(2))
                .map(|ends| [point(ends[0]), point(ends[1])])
                .collect();
            pieces
        });
    pieces.collect()
}

impl OutlineView {
    /// Whether segments lie along most of an outline; `None` where it is not seen.
    fn shows(&self, outline: &[Vector3<f64>; 2], others: &[&Region]) -> Option<bool> {
        let center = &self.camera.center_in_world;
        let (mut asked, mut shown) = (0, 0);
        for k in 0..SAMPLES {
            let place = (k as f64 + 0.5) / SAMPLES as f64;
            let [point, next] = [place, place + STEP].map(|place| point_along(outline, place));
            let pixels = [point, next].map(|point| project_in_front(&self.camera, &point));
            let [Some(pixel), Some(next)] = pixels else {
                continue;
            };
            let inside = (0.0..f64::from(self.camera.width)).contains(&pixel.x)
                && (0.0..f64::from(self.camera.height)).contains(&pixel.y);
            if inside && !others.iter().any(|other| other.is_between(center, &point)) {
                asked += 1;
                let along = next - pixel;
                shown += usize::from(is_shown(&self.grid, &self.segments, &pixel, &along));
            }
        }
        (asked >= MIN_SAMPLES).then_some(2 * shown >= asked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::{MeasuredGraph, find_shells};
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use neat_core::{CircularArc, Wireframe3d};
    use std::f64::consts::TAU;

    const RADIUS: f64 = 0.4;
    const HALF_HEIGHT: f64 = 0.3;

    /// The shells between two circles, where views show the outlines of a pin between them, or of
    /// one of another radius.
    fn shells(radius: f64) -> Vec<Shell> {
        let circle = |z: f64| CircularArc {
            center: Vector3::z() * z,
            axes: [Vector3::x(), Vector3::y()],
            radius: RADIUS,
            angles: [0.0, TAU],
        };
        // No curve is seen through a face, and all that is shown are outlines.
        let views = cameras_on_sphere(40).into_iter().flat_map(|camera| {
            let center = camera.center_in_world;
            let toward = center.y.atan2(center.x);
            let half = (radius / center.xy().norm()).acos();
            let sides = [toward - half, toward + half];
            let corner =
                |angle: f64, z: f64| Vector3::new(radius * angle.cos(), radius * angle.sin(), z);
            let points: Vec<Vector3<f64>> = (sides.iter().filter(|angle| angle.is_finite()))
                .flat_map(|angle| [-HALF_HEIGHT, HALF_HEIGHT].map(|z| corner(*angle, z)))
                .collect();
            let edges: Vec<[usize; 2]> =
                (0..points.len() / 2).map(|k| [2 * k, 2 * k + 1]).collect();
            views_of_edges(&[camera], &points, &edges)
        });
        let graph = MeasuredGraph {
            wireframe: &Wireframe3d::default(),
            arcs: &[circle(-HALF_HEIGHT), circle(HALF_HEIGHT)],
            splines: &[],
            covariances: &[],
        };
        find_shells(&graph, &views.collect::<Vec<_>>(), &[])
    }

    #[test]
    fn a_pin_whose_outlines_are_elsewhere_is_none() {
        let pin = shells(RADIUS);
        assert!(pin.len() == 1 && pin[0].closed && pin[0].faces.len() == 3);
        // Two circles of a dumbbell, or of a waist.
        for radius in [0.8 * RADIUS, 1.2 * RADIUS] {
            let shells = shells(radius);
            assert!(!shells.iter().any(|shell| shell.closed), "{radius}");
        }
    }
}
