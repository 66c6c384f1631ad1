//! What images say about the round faces of solids by their outlines: straight lines along rulings at
//! which the surface turns away from the camera. They are no curves of the wireframe.
//!
//! Two circles are the rims of a cylinder or a cone, or of something else: where nothing else of a
//! solid hides the outlines of such a face, they are shown, each with a probability of [`SHOWN`]; if it
//! is none, by chance.

use super::curves::Curves;
use super::face::{CurveIndex, Face, Shell};
use super::region::Region;
use super::selection::MOST_AGAINST;
use super::surface::Surface;
use super::visibility::{BY_CHANCE, DetectedView};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Probability that 2D segments lie along an outline that is seen: 22 cylinders and cones of right
/// solids show .74 and more of theirs, a median of .92, on renderings; photographs may show less.
const SHOWN: f64 = 0.8;
/// Points along an outline that are asked for …
const SAMPLES: usize = 16;
/// … and how many of them have to be in the image and hidden by no face, so that it is.
const MIN_SAMPLES: usize = 8;

/// The views that may show outlines.
pub(super) struct Outlines<'a> {
    pub views: &'a [DetectedView],
}

impl Outlines<'_> {
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
            let angles = surface.outline_angles(&view.camera.center_in_world);
            let angles = angles.into_iter().flatten();
            let outlines = angles.flat_map(|angle| surface.pieces_at(loops, angle));
            let seen: Vec<bool> = outlines
                .filter_map(|outline| shows(view, &outline, others))
                .collect();
            [seen.iter().filter(|shown| **shown).count(), seen.len()]
        });
        counts.reduce(|| [0, 0], |a, b| [a[0] + b[0], a[1] + b[1]])
    }
}

/// Whether segments of a view lie along most of an outline; `None` where it is not seen.
fn shows(view: &DetectedView, outline: &[Vector3<f64>; 2], others: &[&Region]) -> Option<bool> {
    let center = &view.camera.center_in_world;
    let (mut asked, mut shown) = (0, 0);
    for k in 0..SAMPLES {
        let place = (k as f64 + 0.5) / SAMPLES as f64;
        let Some((point, pixel, along)) = view.look_up(outline, place) else {
            continue;
        };
        if !others.iter().any(|other| other.is_between(center, &point)) {
            asked += 1;
            shown += usize::from(view.is_shown(&pixel, &along));
        }
    }
    (asked >= MIN_SAMPLES).then_some(2 * shown >= asked)
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
        let nothing = Wireframe3d::default();
        let graph = MeasuredGraph {
            arcs: &[circle(-HALF_HEIGHT), circle(HALF_HEIGHT)],
            ..MeasuredGraph::of(&nothing)
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
