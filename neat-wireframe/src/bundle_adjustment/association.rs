//! Which detections observe an edge: in every view the best one that lies on it.

use super::BundleAdjustmentConfig;
use super::residuals::{EdgeObservation, ObservedEdge};
use crate::ViewObservation;
use crate::index::SegmentGrid;
use crate::projection::project_in_front;
use crate::segment_matching::match_segment;
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment2;
use rayon::prelude::*;

/// Where detections need not even cover this share of an edge, so many places on
/// it would have to be looked at that all detections are looked at instead.
const MIN_OVERLAP_FOR_INDEX: f64 = 0.05;

/// The edges that at least one view observes, with their detections.
pub(super) fn associate_edges(
    views: &[ViewObservation],
    junctions: &[Vector3<f64>],
    edges: &[[usize; 2]],
    association_in_pixels: f64,
    config: &BundleAdjustmentConfig,
) -> Vec<ObservedEdge> {
    let views: Vec<IndexedView> = views.par_iter().map(IndexedView::new).collect();
    edges
        .par_iter()
        .filter(|[a, b]| a != b && *a < junctions.len() && *b < junctions.len())
        .map(|edge| {
            ObservedEdge::associate(*edge, &views, junctions, association_in_pixels, config)
        })
        .filter(|edge| !edge.observations.is_empty())
        .collect()
}

/// A view whose detections are found by place.
struct IndexedView<'a> {
    view: &'a ViewObservation,
    grid: SegmentGrid,
}

impl<'a> IndexedView<'a> {
    fn new(view: &'a ViewObservation) -> Self {
        let segments: Vec<_> = view.segments.iter().map(|s| s.segment).collect();
        let grid = SegmentGrid::new(&segments, view.camera.width, view.camera.height);
        Self { view, grid }
    }

    /// Names every detection with all of it at most `max_distance` from the
    /// edge's line that covers more than `min_overlap` of the edge, and others;
    /// some more than once.
    fn for_each_near(
        &self,
        edge: &LineSegment2,
        max_distance: f64,
        min_overlap: f64,
        mut visit: impl FnMut(usize),
    ) {
        if min_overlap >= MIN_OVERLAP_FOR_INDEX {
            // What covers more than this share of the edge covers a multiple of it.
            let places = (1..).map(|i| min_overlap * f64::from(i));
            for place in places.take_while(|place| *place < 1.0) {
                let point = edge.point_at(place);
                self.grid.for_each_near(&point, max_distance, &mut visit);
            }
        } else {
            (0..self.view.segments.len()).for_each(visit);
        }
    }
}

impl ObservedEdge {
    fn associate(
        junctions_of_edge: [usize; 2],
        views: &[IndexedView],
        junctions: &[Vector3<f64>],
        association_in_pixels: f64,
        config: &BundleAdjustmentConfig,
    ) -> Self {
        let [a, b] = junctions_of_edge.map(|junction| junctions[junction]);
        let observations = views
            .iter()
            .filter_map(|view| {
                let camera = &view.view.camera;
                let edge =
                    LineSegment2::new(project_in_front(camera, &a)?, project_in_front(camera, &b)?);
                EdgeObservation::best(&edge, view, association_in_pixels, config)
            })
            .collect();
        Self {
            junctions: junctions_of_edge,
            observations,
        }
    }
}

impl EdgeObservation {
    /// The detection that lies on the projected edge with the nearest ends, if
    /// any does; of equal ones the first.
    fn best(
        edge: &LineSegment2,
        indexed: &IndexedView,
        association_in_pixels: f64,
        config: &BundleAdjustmentConfig,
    ) -> Option<Self> {
        let length = edge.length();
        if length < config.min_projected_length_in_pixels {
            return None;
        }
        let max_distance = (config.max_relative_distance * length).min(association_in_pixels);
        let view = indexed.view;
        let mut best: Option<(f64, usize)> = None;
        indexed.for_each_near(edge, max_distance, config.min_overlap, |index| {
            let detection = &view.segments[index].segment;
            let fit = match_segment(edge, detection);
            let lies_on_edge = fit.perpendicular_distance < max_distance
                && fit.overlap > config.min_overlap
                && detection.length() < config.max_relative_length * length;
            let candidate = (fit.end_distance, index);
            if lies_on_edge && best.is_none_or(|best| candidate < best) {
                best = Some(candidate);
            }
        });
        let best = view.segments.get(best?.1)?;
        let near_end = |pixel: &Vector2<f64>| {
            let [start, end] = best.segment.ends();
            let nearest = if (end - pixel).norm() < (start - pixel).norm() {
                end
            } else {
                start
            };
            ((nearest - pixel).norm() < association_in_pixels).then_some(nearest)
        };
        Some(Self {
            camera: view.camera,
            detection: best.segment,
            ends: [near_end(&edge.start), near_end(&edge.end)],
            weight: best.score.max(0.0).powf(config.score_exponent),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};

    #[test]
    fn the_index_finds_what_a_scan_finds() {
        let mut noise = Noise(41);
        let (junctions, edges) = cube();
        let mut views = views_of_edges(&cameras_on_sphere(6), &junctions, &edges);
        for view in &mut views {
            let segments = view.segments.clone();
            for _ in 0..20 {
                for detection in &segments {
                    let mut cut = *detection;
                    let [from, to] = [noise.uniform(), noise.uniform()].map(|x| 0.5 + 0.6 * x);
                    cut.segment = LineSegment2::new(
                        detection.segment.point_at(from) + 5.0 * noise.vector().xy(),
                        detection.segment.point_at(to) + 5.0 * noise.vector().xy(),
                    );
                    view.segments.push(cut);
                }
            }
            view.segments.extend(segments);
        }
        let moved: Vec<_> = junctions
            .iter()
            .map(|x| x + 0.01 * noise.vector())
            .collect();
        for min_overlap in [0.4, 0.05, 0.7] {
            let config = BundleAdjustmentConfig {
                min_overlap,
                ..Default::default()
            };
            for view in &views {
                let indexed = IndexedView::new(view);
                for [a, b] in &edges {
                    let project = |i: usize| view.camera.project(&moved[i]).pixel;
                    let edge = LineSegment2::new(project(*a), project(*b));
                    let best = EdgeObservation::best(&edge, &indexed, 8.0, &config);
                    assert_eq!(
                        best.map(|best| best.detection),
                        best_by_scan(&edge, view, 8.0, &config)
                    );
                }
            }
        }
    }

    /// The definition: every detection of the view is looked at.
    fn best_by_scan(
        edge: &LineSegment2,
        view: &ViewObservation,
        association_in_pixels: f64,
        config: &BundleAdjustmentConfig,
    ) -> Option<LineSegment2> {
        let length = edge.length();
        let max_distance = (config.max_relative_distance * length).min(association_in_pixels);
        view.segments
            .iter()
            .map(|detection| (match_segment(edge, &detection.segment), detection.segment))
            .filter(|(fit, detection)| {
                fit.perpendicular_distance < max_distance
                    && fit.overlap > config.min_overlap
                    && detection.length() < config.max_relative_length * length
            })
            .min_by(|(a, _), (b, _)| a.end_distance.total_cmp(&b.end_distance))
            .map(|(_, detection)| detection)
    }
}
