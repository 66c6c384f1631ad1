//! Junctions moved until the edges between them lie on the edgels of all views.

use super::edge_samples::{Images, project_segment};
use super::line_selection::ChosenLine;
use crate::bundle_adjustment::{EdgeObservation, Loss, ObservedEdge, bundle_adjust};
use crate::projection::project_in_front;
use crate::solve::{Cauchy, reweighted};
use nalgebra::{Vector2, Vector3};
use neat_core::{LineSegment2, LineSegment3, Wireframe3d};
use rayon::prelude::*;

/// Edgels are sought again after the first adjustment.
const ROUNDS: usize = 2;
/// Where they are sought, in reaches: junctions have moved the lines.
const SEARCH: f64 = 1.5;
/// Weight of the places of the ends along the edges, which only keeps free ends in place.
const END_WEIGHT: f64 = 0.05;
/// Scale of the Cauchy loss, in reaches: as for lines.
const LOSS_SCALE: f64 = 0.6;
/// Fewer edgels of a view determine no segment.
const MIN_EDGELS: usize = 4;
/// A segment of edgels is longer than this, in pixels.
const MIN_LENGTH: f64 = 3.0;

/// Moves `junctions`; `ends` are those of each line.
pub(super) fn fit_graph(
    images: &Images,
    lines: &[ChosenLine],
    ends: &[[usize; 2]],
    junctions: &mut Vec<Vector3<f64>>,
) {
    let loss = Loss {
        cauchy_scale_in_pixels: LOSS_SCALE * images.reach,
        end_weight: END_WEIGHT,
    };
    for _ in 0..ROUNDS {
        let observed: Vec<ObservedEdge> = (lines.par_iter().zip(ends))
            .map(|(chosen, ends)| ObservedEdge {
                junctions: *ends,
                observations: observations(images, chosen, ends.map(|end| junctions[end])),
            })
            .collect();
        *junctions = bundle_adjust(&observed, junctions, loss).junctions;
    }
}

/// Moves the junctions of a wireframe, each of whose edges is seen where it is itself: not where
/// the line is that it has been cut from. Where that was placed by profiles it stays, though:
/// `sources` are the lines of the edges, of `lines`.
pub(super) fn fit_edges(
    images: &Images,
    lines: &[ChosenLine],
    sources: &[Option<usize>],
    wireframe: &mut Wireframe3d,
) {
    let Wireframe3d { junctions, edges } = wireframe;
    let pieces: Vec<ChosenLine> = (edges.par_iter().zip(sources))
        .map(|(edge, source)| {
            if let Some(line) = source
                .map(|source| &lines[source])
                .filter(|line| line.placed)
            {
                return line.clone();
            }
            let [start, end] = edge.map(|end| junctions[end]);
            let line = LineSegment3::new(start, end);
            let evidence = images.evidence(&line, None, f64::NEG_INFINITY);
            ChosenLine {
                line,
                evidence,
                placed: false,
            }
        })
        .collect();
    fit_graph(images, &pieces, edges, junctions);
}

fn observations(
    images: &Images,
    chosen: &ChosenLine,
    [start, end]: [Vector3<f64>; 2],
) -> Vec<EdgeObservation> {
    let edge = LineSegment3::new(start, end);
    let piece = LineSegment3::new(
        chosen.line.point_at(chosen.line.line_parameter(&start)),
        chosen.line.point_at(chosen.line.line_parameter(&end)),
    );
    (chosen.evidence.views())
        .filter_map(|view| {
            let camera = images.views[view].camera;
            let (detection, count) = if chosen.placed {
                let count = images.samples(view, &piece, [0.0, 1.0], None)?.len();
                (project_segment(&images.views[view], &piece)?, count)
            } else {
                let edgels = images.edgels_beside(view, &edge, SEARCH * images.reach);
                let projected = project_segment(&images.views[view], &edge)?;
                let detection = segment_through(&edgels, &projected, images.reach)?;
                (detection, edgels.len())
            };
            Some(EdgeObservation {
                camera,
                detection,
                ends: [start, end].map(|end| project_in_front(&camera, &end)),
                // As in the fit of a line.
                weight: (count as f64).sqrt(),
            })
        })
        .collect()
}

/// The segment through points beside another, as far as they reach, hardly moved by outliers.
fn segment_through(
    points: &[Vector2<f64>],
    beside: &LineSegment2,
    scale: f64,
) -> Option<LineSegment2> {
    if points.len() < MIN_EDGELS {
        return None;
    }
    let direction = (beside.end - beside.start).try_normalize(1e-9)?;
    let normal = Vector2::new(-direction.y, direction.x);
    let rows: Vec<(Vector2<f64>, f64)> = (points.iter())
        .map(|point| {
            let offset = point - beside.start;
            (
                Vector2::new(1.0, offset.dot(&direction)),
                offset.dot(&normal),
            )
        })
        .collect();
    let loss = Cauchy { scale: 0.5 * scale };
    let line = reweighted(&rows, loss, 0.0)?.solution;
    let at = |along: f64| {
        beside.start + direction * along + normal * line.dot(&Vector2::new(1.0, along))
    };
    let along = rows.iter().map(|(row, _)| row.y);
    let (first, last) = (
        along.clone().fold(f64::INFINITY, f64::min),
        along.fold(f64::NEG_INFINITY, f64::max),
    );
    (last - first > MIN_LENGTH).then(|| LineSegment2::new(at(first), at(last)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::TestViews;
    use crate::test_scenes::cube;

    #[test]
    fn a_segment_runs_through_most_points() {
        let beside = LineSegment2::new(Vector2::new(10.0, 10.0), Vector2::new(50.0, 10.0));
        let mut points: Vec<_> = (0..30)
            .map(|k| Vector2::new(12.0 + f64::from(k), 10.3 + 0.01 * f64::from(k)))
            .collect();
        points[7].y += 3.0;
        let found = segment_through(&points, &beside, 0.5).unwrap();
        assert!((found.start - Vector2::new(12.0, 10.3)).norm() < 0.02);
        assert!((found.end - Vector2::new(41.0, 10.59)).norm() < 0.02);
        assert!(segment_through(&points[..3], &beside, 0.5).is_none());
        assert!(segment_through(&[points[0]; 5], &beside, 0.5).is_none());
    }

    #[test]
    fn edges_come_to_lie_where_the_images_show_them() {
        let (truth, edges) = cube();
        let mut wireframe = Wireframe3d {
            junctions: truth.to_vec(),
            edges: edges.to_vec(),
        };
        wireframe.junctions[6] += Vector3::new(0.002, -0.001, 0.001);
        fit_edges(
            &TestViews::of_cube(12).images(),
            &[],
            &[None; 12],
            &mut wireframe,
        );
        for (fitted, truth) in wireframe.junctions.iter().zip(&truth) {
            assert!((fitted - truth).norm() < 2e-4, "{fitted} {truth}");
        }
    }
}
