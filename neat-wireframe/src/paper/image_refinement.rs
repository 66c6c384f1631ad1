//! Junctions moved to where the 2D segments are that chose them, and told from places where
//! segments were cut. Not in the paper.
//!
//! The field says which 2D segments of all views show one edge: those whose NEAT lines end
//! at the same two junctions. No segment is matched to another. Where the edge lies, the
//! segments then say better than the field: a segment is off by less than a pixel, a
//! rendered one by several.

use super::attraction::attracted_ends;
use super::corner_evidence::corner_evidence;
use super::junction_merging::{AttractingJunction, EndKey, EndScatter, merged};
use super::neat_lines::NeatLine;
use crate::ViewObservation;
use crate::bundle_adjustment::{EdgeObservation, Loss, ObservedEdge, bundle_adjust};
use crate::observation::end_key;
use crate::projection::project_in_front;
use crate::statistics::upper_median;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

// Guesses: halved or doubled, each of these and of the settings changes the mean F of segments
// on nine fields of seven objects by less than 0.01, that of junctions by 0.013 at most. That
// was before corners were told from cuts, and copies from corners.

/// Lines are asked for their junctions so often: moved and merged ones attract others. With
/// two and four all is the same.
const ROUNDS: usize = 3;
/// What residuals of the fit count.
const LOSS: Loss = Loss {
    // Detected lines lie nearer to their edge.
    cauchy_scale_in_pixels: 1.0,
    // Beside that of its line: ends scatter farther, along the line.
    end_weight: 0.3,
};

/// How junctions are fitted to the images.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImageRefinementConfig {
    /// Whether they are. The published code has no such step. All NEAT lines take part
    /// then, supported or not, and all junctions, whatever votes they have.
    pub enabled: bool,
    /// A 2D segment speaks for an edge if both ends lie nearer to the projected junctions
    /// than this, in pixels: as far as a field may be off. Junctions nearer to each other than
    /// this may be one corner.
    pub max_end_distance: f64,
}

impl Default for ImageRefinementConfig {
    fn default() -> Self {
        Self {
            enabled: false,
            max_end_distance: 10.0,
        }
    }
}

/// Moves and merges `junctions` until the edges between them lie on the 2D segments of the
/// NEAT lines that they attract, and leaves out those between which segments are cut: with the
/// number of 2D segments of each. Junctions that attract none are left out.
pub(super) fn refine_by_images(
    junctions: Vec<Vector3<f64>>,
    views: &[ViewObservation],
    lines_by_view: &[Vec<NeatLine>],
    config: &ImageRefinementConfig,
) -> Vec<(Vector3<f64>, usize)> {
    let round = |junctions: &[Vector3<f64>]| {
        let attracted = attracted_segments(junctions, views, lines_by_view, config);
        let edges = observed_edges(&attracted, views);
        let junctions = bundle_adjust(&edges, junctions, LOSS).junctions;
        let scatter = EndScatter {
            scale: LOSS.cauchy_scale_in_pixels,
            gate: config.max_end_distance,
        };
        merged(attracting(&junctions, &attracted, views), views, scatter)
    };
    let places = |refined: &[(Vector3<f64>, usize)]| -> Vec<Vector3<f64>> {
        refined.iter().map(|(place, _)| *place).collect()
    };
    let mut refined: Vec<_> = junctions.into_iter().map(|place| (place, 0)).collect();
    for _ in 0..ROUNDS {
        refined = round(&places(&refined));
    }
    // What the others attracted goes to these, or nowhere.
    round(&ends_of_edges(
        &places(&refined),
        views,
        lines_by_view,
        config,
    ))
}

/// The junctions at which 2D segments end because a corner is there, and those that 2D segments
/// join to one: an edge may end where nothing else does, or something hides it, but one between
/// two places that are no corners is a piece of something longer.
fn ends_of_edges(
    junctions: &[Vector3<f64>],
    views: &[ViewObservation],
    lines_by_view: &[Vec<NeatLine>],
    config: &ImageRefinementConfig,
) -> Vec<Vector3<f64>> {
    let attracted = attracted_segments(junctions, views, lines_by_view, config);
    let is_corner = |junction: &AttractingJunction| {
        let distance = |((view, _), end): (&EndKey, &Vector2<f64>)| {
            let pixel = project_in_front(&views[*view].camera, &junction.place)?;
            Some((pixel - end).norm())
        };
        let distances: Vec<f64> = junction.ends.iter().filter_map(distance).collect();
        // Nearer ends than what the fit takes for noise tell no more of a corner: junctions
        // that became one had each its own.
        let scale = LOSS.cauchy_scale_in_pixels;
        corner_evidence(&distances, config.max_end_distance, scale) > 0.0
    };
    let attracting = attracting(junctions, &attracted, views);
    let is_corner: Vec<bool> = attracting.iter().map(is_corner).collect();
    let mut kept = is_corner.clone();
    for AttractedSegment { junctions, .. } in &attracted {
        let [a, b] = *junctions;
        kept[a] |= is_corner[b];
        kept[b] |= is_corner[a];
    }
    let told = junctions.iter().zip(kept);
    told.filter(|(_, kept)| *kept)
        .map(|(place, _)| *place)
        .collect()
}

/// The edges between junctions that 2D segments show from end to end, each once, sorted: what
/// [`attract`](super::attract) makes of lines, without those that end elsewhere in the image.
pub(super) fn attracted_edges(
    junctions: &[Vector3<f64>],
    views: &[ViewObservation],
    lines_by_view: &[Vec<NeatLine>],
    config: &ImageRefinementConfig,
) -> Vec<[usize; 2]> {
    let attracted = attracted_segments(junctions, views, lines_by_view, config);
    let edges: BTreeSet<[usize; 2]> = attracted.iter().map(|segment| segment.junctions).collect();
    edges.into_iter().collect()
}

/// A 2D segment whose NEAT line two junctions attract.
struct AttractedSegment {
    view: usize,
    /// In ascending order.
    junctions: [usize; 2],
    /// From the first junction to the second.
    detection: LineSegment2,
}

/// The 2D segments of all views whose lines are attracted, and that end near the junctions.
fn attracted_segments(
    junctions: &[Vector3<f64>],
    views: &[ViewObservation],
    lines_by_view: &[Vec<NeatLine>],
    config: &ImageRefinementConfig,
) -> Vec<AttractedSegment> {
    let of_view = |(view, lines): (usize, &Vec<NeatLine>)| -> Vec<AttractedSegment> {
        let attracted =
            |line| attracted_segment(junctions, views, view, line, config.max_end_distance);
        lines.iter().filter_map(attracted).collect()
    };
    let by_view: Vec<_> = (lines_by_view.par_iter().enumerate())
        .map(of_view)
        .collect();
    by_view.into_iter().flatten().collect()
}

/// The 2D segment of a line that is attracted; `None` if it does not end where the junctions lie.
fn attracted_segment(
    junctions: &[Vector3<f64>],
    views: &[ViewObservation],
    view: usize,
    line: &NeatLine,
    max_end_distance: f64,
) -> Option<AttractedSegment> {
    let ViewObservation {
        camera, segments, ..
    } = &views[view];
    let mut ends = attracted_ends(&line.segment, junctions)?;
    let mut detection = segments[line.segment_in_view].segment;
    if ends[0] > ends[1] {
        ends.reverse();
        detection = detection.reversed();
    }
    let near = |junction: usize, end: Vector2<f64>| {
        let pixel = project_in_front(camera, &junctions[junction]);
        pixel.is_some_and(|pixel| (pixel - end).norm() < max_end_distance)
    };
    let [start, end] = ends;
    let is_near = start != end && near(start, detection.start) && near(end, detection.end);
    is_near.then_some(AttractedSegment {
        view,
        junctions: ends,
        detection,
    })
}

/// The edges between junctions, each with the 2D segments that it attracts.
fn observed_edges(attracted: &[AttractedSegment], views: &[ViewObservation]) -> Vec<ObservedEdge> {
    let mut edges: BTreeMap<[usize; 2], Vec<EdgeObservation>> = BTreeMap::new();
    for segment in attracted {
        let observation = EdgeObservation {
            camera: views[segment.view].camera,
            detection: segment.detection,
            ends: segment.detection.ends().map(Some),
            weight: 1.0,
        };
        edges
            .entry(segment.junctions)
            .or_default()
            .push(observation);
    }
    let observed = |(junctions, observations)| ObservedEdge {
        junctions,
        observations,
    };
    edges.into_iter().map(observed).collect()
}

/// All junctions with the ends of the 2D segments that they attract.
fn attracting(
    junctions: &[Vector3<f64>],
    attracted: &[AttractedSegment],
    views: &[ViewObservation],
) -> Vec<AttractingJunction> {
    let mut ends = vec![BTreeMap::new(); junctions.len()];
    // Of each segment the length of a pixel at the junction.
    let mut pixels = vec![Vec::new(); junctions.len()];
    for segment in attracted {
        let camera = &views[segment.view].camera;
        for (junction, end) in segment.junctions.into_iter().zip(segment.detection.ends()) {
            ends[junction].insert(end_key(segment.view, &end), end);
            let depth = camera.project(&junctions[junction]).depth;
            pixels[junction].push(depth / camera.intrinsics.fx);
        }
    }
    let attracting = |((place, ends), mut pixels): ((&Vector3<f64>, _), Vec<f64>)| {
        let segments = pixels.len();
        let pixel = match segments {
            0 => 0.0,
            _ => upper_median(&mut pixels),
        };
        AttractingJunction {
            place: *place,
            ends,
            segments,
            pixel,
        }
    };
    (junctions.iter().zip(ends).zip(pixels))
        .map(attracting)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};
    use neat_core::{LineSegment3, ScoredSegment2};

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

    /// Adds the 2D segment between two points to a view, and its line.
    fn add(view: &mut ViewObservation, lines: &mut Vec<NeatLine>, [a, b]: [Vector3<f64>; 2]) {
        let seen = |place| project_in_front(&view.camera, &place).unwrap();
        let (segment_in_view, segment) = (view.segments.len(), LineSegment2::new(seen(a), seen(b)));
        lines.push(NeatLine {
            segment_in_view,
            segment: LineSegment3::new(a, b),
            rays: 1,
            support_distance: 0.0,
        });
        view.segments.push(ScoredSegment2 {
            segment,
            score: 1.0,
            edge: segment_in_view,
        });
    }

    /// Adds the rim of a hole to the views of a cube: twelve chords, cut elsewhere in each.
    fn add_rim(views: &mut [ViewObservation], lines: &mut [Vec<NeatLine>]) {
        let mut noise = Noise(3);
        for (view, lines) in views.iter_mut().zip(lines) {
            let turn = noise.uniform();
            for chord in 0..12 {
                add(view, lines, [chord, chord + 1].map(|cut| on_rim(cut, turn)));
            }
        }
    }

    /// One of twelve places on the rim, all of which are moved along by `turn` of a radian.
    fn on_rim(place: usize, turn: f64) -> Vector3<f64> {
        let (sin, cos) = (place as f64 * std::f64::consts::TAU / 12.0 + turn).sin_cos();
        Vector3::new(0.25 * cos, 0.25 * sin, 0.5)
    }

    #[test]
    fn cuts_of_a_rim_are_no_corners() {
        let (mut views, mut lines) = field_of_cube(0.01);
        add_rim(&mut views, &mut lines);
        let (corners, _) = cube();
        let mut junctions = corners.clone();
        junctions.extend((0..12).map(|place| on_rim(place, 0.0)));
        let config = ImageRefinementConfig::default();
        let refined = refine_by_images(junctions, &views, &lines, &config);
        assert_eq!(refined.len(), corners.len());
        for (junction, _) in &refined {
            let off = corners.iter().map(|corner| (junction - corner).norm());
            assert!(off.fold(f64::INFINITY, f64::min) < 1e-3);
        }
    }

    #[test]
    fn an_edge_of_a_corner_may_end_anywhere() {
        let (mut views, mut lines) = field_of_cube(0.01);
        let (mut junctions, _) = cube();
        let [corner, end] = [junctions[0], 1.8 * junctions[0]];
        let mut noise = Noise(4);
        let mut far_ends = Vec::new();
        for (view, lines) in views.iter_mut().zip(&mut lines) {
            let cut = end * (1.0 + 0.02 * noise.uniform());
            far_ends.push(view.camera.project(&cut).pixel - view.camera.project(&end).pixel);
            add(view, lines, [corner, cut]);
        }
        let config = ImageRefinementConfig::default();
        let distances: Vec<f64> = far_ends.iter().map(|end| end.norm()).collect();
        assert!(corner_evidence(&distances, config.max_end_distance, 1.0) < 0.0);
        junctions.push(end);
        let refined = refine_by_images(junctions, &views, &lines, &config);
        assert_eq!(refined.len(), 9);
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
