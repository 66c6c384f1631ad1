//! Junctions moved to where the 2D segments are that chose them. Not in the paper.
//!
//! The field says which 2D segments of all views show one edge: those whose NEAT lines end
//! at the same two junctions. No segment is matched to another. Where the edge lies, the
//! segments then say better than the field: a segment is off by less than a pixel, a
//! rendered one by several.

use super::attraction::attracted_ends;
use super::neat_lines::NeatLine;
use crate::ViewObservation;
use crate::bundle_adjustment::{EdgeObservation, Loss, ObservedEdge, bundle_adjust};
use crate::projection::project_in_front;
use crate::statistics::upper_median;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BTreeMap;

// Guesses: halved or doubled, each of these and of the settings changes the mean F of segments
// on nine fields of seven objects by less than 0.01, that of junctions by 0.013 at most.

/// Lines are asked for their junctions so often: moved and merged ones attract others. With
/// two and four all is the same.
const ROUNDS: usize = 3;
/// Scale of the robust loss, in pixels: detected lines lie nearer to their edge.
const LOSS_SCALE: f64 = 1.0;
/// Weight of a detected end beside that of its line: ends scatter farther, along the line.
const END_WEIGHT: f64 = 0.3;

/// How junctions are fitted to the images.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImageRefinementConfig {
    /// Whether they are. The published code has no such step. All NEAT lines take part
    /// then, supported or not, and all junctions, whatever votes they have.
    pub enabled: bool,
    /// A 2D segment speaks for an edge if both ends lie nearer to the projected junctions
    /// than this, in pixels: as far as a field may be off.
    pub max_end_distance: f64,
    /// Junctions nearer to each other than this are one: pixels, at the median distance of
    /// the views that show one of them.
    pub merge_distance: f64,
}

impl Default for ImageRefinementConfig {
    fn default() -> Self {
        Self {
            enabled: false,
            max_end_distance: 10.0,
            merge_distance: 3.0,
        }
    }
}

/// Moves and merges `junctions` until the edges between them lie on the 2D segments of the
/// NEAT lines that they attract; with the number of these segments. Junctions that attract
/// none are left out.
pub(super) fn refine_by_images(
    mut junctions: Vec<Vector3<f64>>,
    views: &[ViewObservation],
    lines_by_view: &[Vec<NeatLine>],
    config: &ImageRefinementConfig,
) -> Vec<(Vector3<f64>, usize)> {
    let loss = Loss {
        cauchy_scale_in_pixels: LOSS_SCALE,
        end_weight: END_WEIGHT,
    };
    let mut refined = Vec::new();
    for _ in 0..ROUNDS {
        let observed = observed_edges(&junctions, views, lines_by_view, config);
        junctions = bundle_adjust(&observed, &junctions, loss).junctions;
        refined = merged(&junctions, &observed, config.merge_distance);
        junctions = refined.iter().map(|(place, _)| *place).collect();
    }
    refined
}

/// The edges that lines are attracted to, each with the 2D segments of its lines.
fn observed_edges(
    junctions: &[Vector3<f64>],
    views: &[ViewObservation],
    lines_by_view: &[Vec<NeatLine>],
    config: &ImageRefinementConfig,
) -> Vec<ObservedEdge> {
    let by_view: Vec<Vec<([usize; 2], EdgeObservation)>> = (views.par_iter().zip(lines_by_view))
        .map(|(view, lines)| {
            let observation = |line| observation(junctions, view, line, config.max_end_distance);
            lines.iter().filter_map(observation).collect()
        })
        .collect();
    let mut edges: BTreeMap<[usize; 2], Vec<EdgeObservation>> = BTreeMap::new();
    for (ends, observation) in by_view.into_iter().flatten() {
        edges.entry(ends).or_default().push(observation);
    }
    let observed = |(junctions, observations)| ObservedEdge {
        junctions,
        observations,
    };
    edges.into_iter().map(observed).collect()
}

/// The junctions that a line is attracted to, in ascending order, and what its 2D segment
/// says about the edge between them; `None` if they do not lie where it ends.
fn observation(
    junctions: &[Vector3<f64>],
    view: &ViewObservation,
    line: &NeatLine,
    max_end_distance: f64,
) -> Option<([usize; 2], EdgeObservation)> {
    let mut ends = attracted_ends(&line.segment, junctions)?;
    let mut detection = view.segments[line.segment_in_view].segment;
    if ends[0] > ends[1] {
        ends.reverse();
        detection = detection.reversed();
    }
    let near = |junction: usize, end: Vector2<f64>| {
        let pixel = project_in_front(&view.camera, &junctions[junction]);
        pixel.is_some_and(|pixel| (pixel - end).norm() < max_end_distance)
    };
    let [start, end] = ends;
    let is_near = start != end && near(start, detection.start) && near(end, detection.end);
    let observation = EdgeObservation {
        camera: view.camera,
        detection,
        ends: detection.ends().map(Some),
        weight: 1.0,
    };
    is_near.then_some((ends, observation))
}

/// One for all junctions that the images hardly tell apart: the one that most 2D segments
/// observe.
fn merged(
    junctions: &[Vector3<f64>],
    observed: &[ObservedEdge],
    distance_in_pixels: f64,
) -> Vec<(Vector3<f64>, usize)> {
    // Of each observation the length of a pixel at the junction.
    let mut pixels = vec![Vec::new(); junctions.len()];
    for edge in observed {
        for EdgeObservation { camera, .. } in &edge.observations {
            for junction in edge.junctions {
                let depth = camera.project(&junctions[junction]).depth;
                pixels[junction].push(depth / camera.intrinsics.fx);
            }
        }
    }
    let mut order: Vec<usize> = (0..junctions.len())
        .filter(|junction| !pixels[*junction].is_empty())
        .collect();
    order.sort_by_key(|junction| Reverse(pixels[*junction].len()));
    let mut kept: Vec<(Vector3<f64>, usize)> = Vec::new();
    for junction in order {
        let radius = distance_in_pixels * upper_median(&mut pixels[junction]);
        let place = junctions[junction];
        if kept
            .iter()
            .all(|(other, _)| (other - place).norm() >= radius)
        {
            kept.push((place, pixels[junction].len()));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};
    use neat_core::LineSegment3;

    /// The views of a cube, and NEAT lines whose ends are off by up to `error`.
    fn field_of_cube(error: f64) -> (Vec<ViewObservation>, Vec<Vec<NeatLine>>) {
        let (corners, edges) = cube();
        let views = views_of_edges(&cameras_on_sphere(12), &corners, &edges);
        let mut noise = Noise(5);
        let mut off = |corner: usize| corners[corner] + error * noise.vector();
        let mut lines_of_view = || {
            let lines = edges.iter().enumerate().map(|(edge, [a, b])| NeatLine {
                segment_in_view: edge,
                segment: LineSegment3::new(off(*a), off(*b)),
                rays: 1,
                support_distance: 0.0,
            });
            lines.collect()
        };
        let lines = views.iter().map(|_| lines_of_view()).collect();
        (views, lines)
    }

    #[test]
    fn junctions_come_to_the_corners_that_the_images_show_and_copies_go() {
        let (views, lines) = field_of_cube(0.02);
        let (corners, _) = cube();
        let mut noise = Noise(9);
        // Three for each corner, and one in the middle that attracts nothing.
        let mut junctions = vec![Vector3::zeros()];
        for _ in 0..3 {
            junctions.extend(corners.iter().map(|corner| corner + 0.01 * noise.vector()));
        }
        let config = ImageRefinementConfig::default();
        let refined = refine_by_images(junctions, &views, &lines, &config);
        assert_eq!(refined.len(), corners.len());
        // Three edges meet in each corner, and 12 views see them.
        assert!(refined.iter().all(|(_, segments)| *segments == 36));
        for corner in &corners {
            let off = |(junction, _): &(Vector3<f64>, usize)| (junction - corner).norm();
            let nearest = refined.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-3, "{nearest}");
        }
    }

    #[test]
    fn segments_far_from_the_junctions_say_nothing() {
        let (views, lines) = field_of_cube(0.0);
        let (corners, _) = cube();
        let shifted: Vec<_> = (corners.iter())
            .map(|corner| corner + Vector3::new(0.0, 0.0, 0.2))
            .collect();
        let config = ImageRefinementConfig::default();
        assert!(refine_by_images(shifted, &views, &lines, &config).is_empty());
        assert!(refine_by_images(corners, &[], &[], &config).is_empty());
    }
}
