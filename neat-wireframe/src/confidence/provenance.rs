//! Provenance: which 2D segments of which views show an edge.
//!
//! A segment supports an edge if it lies on its projection. Where several edges
//! claim the same piece of a segment, the nearest one has it; different pieces of
//! one segment may support different edges (a line that is one in the image, two
//! in the graph), and several segments of a view one edge (fragments).

use super::config::ProvenanceConfig;
use crate::ViewObservation;
use crate::metrics::visible_projection;
use crate::segment_grid::SegmentGrid;
use neat_core::{Camera, LineSegment2, LineSegment3};
use rayon::prelude::*;

/// A 2D segment that supports an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeSupport {
    /// Index of the view.
    pub view: usize,
    /// Index into that view's [`ViewObservation::segments`].
    pub segment_in_view: usize,
    /// The segment in image coordinates, in the order of the edge's junctions.
    pub segment: LineSegment2,
    /// Whether that is the reverse of the order in the view.
    pub reversed: bool,
    /// Root mean square distance of its ends from the projected edge's line, in
    /// pixels.
    pub residual_in_pixels: f64,
}

/// What all views say about an edge.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct EdgeProvenance {
    /// By ascending view and segment.
    pub supports: Vec<EdgeSupport>,
    /// The views whose supports cover enough of the edge, ascending …
    pub showing_views: Vec<usize>,
    /// … and the number of those in which they cover all of it.
    pub whole_views: usize,
}

/// A view with a valid camera, and where its finite segments lie.
pub(super) struct IndexedView<'a> {
    observation: &'a ViewObservation,
    /// Indices into the observation's segments, in the order of `index`.
    segments: Vec<usize>,
    index: SegmentGrid,
}

impl<'a> IndexedView<'a> {
    /// `None` for a view whose camera cannot be used.
    pub(super) fn new(observation: &'a ViewObservation) -> Option<Self> {
        let camera = &observation.camera;
        camera.validate().ok()?;
        let (segments, shapes): (Vec<usize>, Vec<LineSegment2>) = observation
            .segments
            .iter()
            .enumerate()
            .map(|(index, detection)| (index, detection.segment))
            .filter(|(_, segment)| segment.length().is_finite() && segment.length() > 0.0)
            .unzip();
        Some(Self {
            index: SegmentGrid::new(&shapes, camera.width, camera.height),
            observation,
            segments,
        })
    }
}

/// A claim of an edge to a piece of a segment.
struct Claim {
    edge: usize,
    segment_in_view: usize,
    fit: Fit,
}

/// How a segment lies on a projected edge.
struct Fit {
    residual: f64,
    /// Whether the segment runs against the edge.
    reversed: bool,
    /// The common part as parameters of the segment in the view …
    on_segment: [f64; 2],
    /// … and of the projected edge.
    on_edge: [f64; 2],
}

/// What the views say about each edge, in the same order. Views that are `None`
/// say nothing.
pub(super) fn provenance(
    views: &[Option<IndexedView>],
    edges: &[LineSegment3],
    config: &ProvenanceConfig,
) -> Vec<EdgeProvenance> {
    let of_views: Vec<Vec<(usize, EdgeProvenance)>> = views
        .par_iter()
        .enumerate()
        .map(|(index, view)| match view {
            Some(view) => view_provenance(index, view, edges, config),
            None => Vec::new(),
        })
        .collect();
    let mut of_edges = vec![EdgeProvenance::default(); edges.len()];
    for (edge, found) in of_views.into_iter().flatten() {
        of_edges[edge].supports.extend(found.supports);
        of_edges[edge].showing_views.extend(found.showing_views);
        of_edges[edge].whole_views += found.whole_views;
    }
    of_edges
}

/// The edges that one view says something about, ascending.
fn view_provenance(
    view_index: usize,
    view: &IndexedView,
    edges: &[LineSegment3],
    config: &ProvenanceConfig,
) -> Vec<(usize, EdgeProvenance)> {
    let camera = &view.observation.camera;
    let mut claims = Vec::new();
    for (edge, segment) in edges.iter().enumerate() {
        let Some(projected) = visible_projection(camera, segment) else {
            continue;
        };
        let length = projected.length();
        if !(length.is_finite() && length >= config.min_projected_length_in_pixels) {
            continue;
        }
        for near in view.index.near(&projected) {
            let segment_in_view = view.segments[near];
            let detection = &view.observation.segments[segment_in_view].segment;
            if let Some(fit) = fit(&projected, detection, config) {
                claims.push(Claim {
                    edge,
                    segment_in_view,
                    fit,
                });
            }
        }
    }
    let mut granted = settle(claims);
    granted.sort_by_key(|claim| (claim.edge, claim.segment_in_view));
    granted
        .chunk_by(|a, b| a.edge == b.edge)
        .map(|claims| {
            let edge = claims[0].edge;
            let supports = claims.iter().map(|claim| {
                let detection = view.observation.segments[claim.segment_in_view].segment;
                EdgeSupport {
                    view: view_index,
                    segment_in_view: claim.segment_in_view,
                    segment: if claim.fit.reversed {
                        detection.reversed()
                    } else {
                        detection
                    },
                    reversed: claim.fit.reversed,
                    residual_in_pixels: claim.fit.residual,
                }
            });
            let covered: Vec<[f64; 2]> = claims.iter().map(|claim| claim.fit.on_edge).collect();
            let share = covered_share(camera, &edges[edge], &covered);
            let shows = share >= config.min_covered_share;
            let found = EdgeProvenance {
                supports: supports.collect(),
                showing_views: shows.then_some(view_index).into_iter().collect(),
                whole_views: usize::from(shows && share >= 1.0),
            };
            (edge, found)
        })
        .collect()
}

/// Whether and how a segment lies on a projected edge.
fn fit(edge: &LineSegment2, segment: &LineSegment2, config: &ProvenanceConfig) -> Option<Fit> {
    let length = edge.length();
    let direction = (edge.end - edge.start) / length;
    let from_start = segment.ends().map(|end| end - edge.start);
    let across = from_start.map(|offset| offset.perp(&direction));
    let along = from_start.map(|offset| offset.dot(&direction));
    let farther = across[0].abs().max(across[1].abs());
    let tilt = (across[0] - across[1]).abs();
    let max_tilt = (config.max_angle_in_degrees.to_radians().sin() * segment.length())
        .max(config.max_tilt_in_pixels);
    if farther > config.tolerance_in_pixels || tilt > max_tilt {
        return None;
    }
    let [low, high] = [along[0].min(along[1]), along[0].max(along[1])];
    let common = [low.max(0.0), high.min(length)];
    let shorter = length.min(high - low);
    // Written so that numbers that are none fail.
    let overlaps = common[1] - common[0] >= config.min_overlap * shorter && shorter > 0.0;
    let reversed = along[1] < along[0];
    overlaps.then(|| Fit {
        residual: (0.5 * (across[0] * across[0] + across[1] * across[1])).sqrt(),
        reversed,
        on_segment: if reversed {
            [high - common[1], high - common[0]].map(|x| x / (high - low))
        } else {
            common.map(|x| (x - low) / (high - low))
        },
        on_edge: common.map(|x| x / length),
    })
}

/// Grants every piece of a segment to the nearest edge that claims it.
fn settle(mut claims: Vec<Claim>) -> Vec<Claim> {
    /// Pieces that share less than this of the shorter one are different pieces.
    const MAX_COMMON: f64 = 0.5;
    claims.sort_by(|a, b| {
        let by_residual = a.fit.residual.total_cmp(&b.fit.residual);
        let by_segment = a.segment_in_view.cmp(&b.segment_in_view);
        by_segment.then(by_residual).then(a.edge.cmp(&b.edge))
    });
    let mut granted: Vec<Claim> = Vec::new();
    let mut first_of_segment = 0;
    for claim in claims {
        let is_new_segment = granted
            .last()
            .is_none_or(|last| last.segment_in_view != claim.segment_in_view);
        if is_new_segment {
            first_of_segment = granted.len();
        }
        let [low, high] = claim.fit.on_segment;
        let is_free = granted[first_of_segment..].iter().all(|other| {
            let [other_low, other_high] = other.fit.on_segment;
            let common = high.min(other_high) - low.max(other_low);
            common < MAX_COMMON * (high - low).min(other_high - other_low)
        });
        if is_free {
            granted.push(claim);
        }
    }
    granted
}

/// The share of the part of an edge within the image that `covered` parameters of
/// its projection show.
fn covered_share(camera: &Camera, edge: &LineSegment3, covered: &[[f64; 2]]) -> f64 {
    /// Evenly spaced places on the projection that are tested.
    const SAMPLES: usize = 32;
    let Some(projected) = visible_projection(camera, edge) else {
        return 0.0;
    };
    let [width, height] = [camera.width, camera.height].map(f64::from);
    let (mut shown, mut within) = (0_usize, 0_usize);
    for sample in 0..SAMPLES {
        let place = (sample as f64 + 0.5) / SAMPLES as f64;
        let point = projected.point_at(place);
        if (0.0..width).contains(&point.x) && (0.0..height).contains(&point.y) {
            within += 1;
            let is_shown = |[low, high]: &[f64; 2]| (*low..=*high).contains(&place);
            shown += usize::from(covered.iter().any(is_shown));
        }
    }
    shown as f64 / within.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};
    use nalgebra::Vector2;
    use neat_core::ScoredSegment2;

    fn segment(x0: f64, y0: f64, x1: f64, y1: f64) -> LineSegment2 {
        LineSegment2::new(Vector2::new(x0, y0), Vector2::new(x1, y1))
    }

    fn of_cube(observations: &[ViewObservation]) -> Vec<EdgeProvenance> {
        let (junctions, edges) = cube();
        let views: Vec<_> = observations.iter().map(IndexedView::new).collect();
        let edges: Vec<_> = edges
            .iter()
            .map(|[a, b]| LineSegment3::new(junctions[*a], junctions[*b]))
            .collect();
        provenance(&views, &edges, &ProvenanceConfig::default())
    }

    #[test]
    fn every_edge_finds_its_own_segments_in_its_own_direction() {
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(6), &junctions, &edges);
        let detection = &mut observations[2].segments[5].segment;
        *detection = detection.reversed();
        for (edge, found) in of_cube(&observations).iter().enumerate() {
            assert_eq!(found.showing_views, [0, 1, 2, 3, 4, 5]);
            assert_eq!(found.whole_views, 6);
            assert_eq!(found.supports.len(), 6);
            for (view, support) in found.supports.iter().enumerate() {
                assert_eq!((support.view, support.segment_in_view), (view, edge));
                assert!(support.residual_in_pixels < 1e-9);
                assert_eq!(support.reversed, (view, edge) == (2, 5));
                let start = observations[view]
                    .camera
                    .project(&junctions[edges[edge][0]]);
                assert!((support.segment.start - start.pixel).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn fragments_support_one_edge_and_a_long_segment_several() {
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(1), &junctions, &edges);
        let whole = observations[0].segments.remove(3);
        for [from, to] in [[0.02, 0.3], [0.5, 0.95]] {
            observations[0].segments.push(ScoredSegment2 {
                segment: LineSegment2::new(
                    whole.segment.point_at(from),
                    whole.segment.point_at(to),
                ),
                ..whole
            });
        }
        let found = &of_cube(&observations)[3];
        let names: Vec<_> = found.supports.iter().map(|s| s.segment_in_view).collect();
        assert_eq!(names, [11, 12]);
        assert_eq!(found.showing_views, [0]);
        assert_eq!(found.whole_views, 0);

        let config = ProvenanceConfig::default();
        let long = segment(0.0, 0.2, 100.0, 0.0);
        let claims = [(0.0, 48.0), (100.0, 52.0), (1.0, 50.0)]
            .iter()
            .enumerate()
            .map(|(edge, (from, to))| {
                // The third edge claims what the first one has, from farther away.
                let y = if edge == 2 { 1.5 } else { 0.0 };
                let fit = fit(&segment(*from, y, *to, y), &long, &config).unwrap();
                Claim {
                    edge,
                    segment_in_view: 0,
                    fit,
                }
            });
        let mut granted: Vec<_> = settle(claims.collect()).iter().map(|c| c.edge).collect();
        granted.sort_unstable();
        assert_eq!(granted, [0, 1]);
    }

    #[test]
    fn what_lies_beside_across_or_beyond_does_not_support() {
        let config = ProvenanceConfig::default();
        let edge = segment(0.0, 0.0, 100.0, 0.0);
        assert!(fit(&edge, &segment(90.0, 1.0, 10.0, -0.5), &config).is_some());
        for other in [
            segment(10.0, 4.5, 90.0, 4.5),
            segment(50.0, -2.0, 52.0, 2.9),
            segment(95.0, 0.0, 150.0, 0.0),
            segment(50.0, 0.0, 50.0, 0.0),
        ] {
            assert!(fit(&edge, &other, &config).is_none(), "{other:?}");
        }
    }

    #[test]
    fn broken_views_and_segments_say_nothing() {
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(3), &junctions, &edges);
        observations[0].camera.intrinsics.fx = f64::NAN;
        observations[1].segments[0].segment.start.x = f64::NAN;
        observations[1].segments[1].segment.start.x = f64::INFINITY;
        let found = of_cube(&observations);
        assert_eq!(found[0].showing_views, [2]);
        assert_eq!(found[1].showing_views, [2]);
        assert_eq!(found[2].showing_views, [1, 2]);
    }
}
