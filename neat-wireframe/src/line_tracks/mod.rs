//! The line-track back end: 2D wireframes of posed views, matched across views,
//! give the 3D wireframe directly.
//!
//! Where the other back ends take positions or neighbourhoods from a neural
//! field, this one takes them from the images alone, so its cost grows with the
//! number of 2D segments and not with what a field can memorise. The field, if
//! there is one, breaks ties between repeated structures ([`SegmentProposal`]s as
//! priors) and tells where edges ought to be seen (a [`SignedDistance`]).
//!
//! The steps: neighbouring views; candidate partners of every segment by the
//! epipolar geometry; scores of the 3D positions that they make; one position per
//! segment by mutual agreement; tracks of segments on one line; merging; a graph
//! of junctions where 2D vertices join tracks; bundle adjustment of that graph;
//! free ends that meet something, and edges cut where others end on or cross them.
//! Matching and scoring follow Hofer, Maurer and Bischof, *Efficient 3D scene
//! abstraction using line segments* (Line3D++, 2017).
//!
//! All steps work in a world whose scene ball is the unit ball around the
//! origin; thresholds are pixels of the images.

mod certain_line;
mod clustering;
mod config;
mod consensus;
mod edge_confirmation;
mod edge_crossings;
mod edge_splitting;
mod end_joining;
mod epipolar_matching;
mod free_end_search;
mod free_ends;
mod graph_adjustment;
mod graph_segmentation;
mod hypothesis_scoring;
mod isolated_edges;
mod junction_graph;
mod line3d;
mod line_refinement;
mod neighbours;
mod parallel_edges;
mod projected_line;
mod report;
mod straight_junctions;
mod track_merging;
mod view_segments;

#[cfg(test)]
mod test_tracks;

pub use clustering::ClusteringConfig;
pub use config::LineTracksConfig;
pub use consensus::ConsensusConfig;
pub use edge_confirmation::EdgeConfirmationConfig;
pub use edge_splitting::EdgeSplittingConfig;
pub use epipolar_matching::EpipolarMatchingConfig;
pub use free_ends::FreeEndsConfig;
pub use graph_adjustment::GraphAdjustmentConfig;
pub use hypothesis_scoring::HypothesisScoringConfig;
pub use isolated_edges::IsolatedEdgesConfig;
pub use junction_graph::JunctionGraphConfig;
pub use line_refinement::LineRefinementConfig;
pub use line3d::{Line3dConfig, Line3dSegment, line3d, wireframe_of_segments};
pub use neighbours::NeighboursConfig;
pub use parallel_edges::ParallelEdgesConfig;
pub use report::{LineEvidence, LineTracksReport, LineTracksResult, SegmentSupport, StepTiming};
pub use straight_junctions::StraightJunctionsConfig;
pub use track_merging::TrackMergingConfig;

use crate::evidence::occlusion::visible_views;
use crate::signed_distance::UnitBallSurface;
use crate::{SegmentProposal, SignedDistance, ViewObservation, Wireframe3d};
use clustering::{grow_tracks, view_count};
use consensus::find_consensus;
use edge_confirmation::confirm_edges;
use edge_crossings::add_crossings;
use edge_splitting::split_edges;
use free_ends::join_free_ends;
use graph_adjustment::{adjust_graph, noise_in_pixels};
use hypothesis_scoring::{DepthPrior, score_hypotheses};
use isolated_edges::drop_isolated;
use junction_graph::{GraphEdge, JunctionGraph, junction_graph};
use parallel_edges::merge_parallel;
use rayon::prelude::*;
use std::time::Instant;
use straight_junctions::dissolve_straight;
use track_merging::{gather_unclaimed, merge_duplicates};
use view_segments::{SegmentId, TrackView, segment_of};

/// Builds the wireframe.
///
/// - `observations`: cameras and detected segments. Segments whose ends have the
///   same coordinates share a vertex. Views without a valid camera do not count.
/// - `priors`: 3D segments with indices into `observations` that something else
///   proposes, or none. They break ties; those that are not finite or name
///   nothing do not count.
/// - `surface`: for the occlusion test, asked in the world of the cameras.
/// - `scene_radius`: radius of the ball around the world's origin in which the
///   structure lies.
///
/// The result is empty where nothing can be built: too few usable views, a
/// radius that is not a positive number. But for the timings it does not depend
/// on the number of threads.
pub fn run(
    observations: &[ViewObservation],
    priors: &[SegmentProposal],
    surface: Option<&dyn SignedDistance>,
    scene_radius: f64,
    config: &LineTracksConfig,
) -> LineTracksResult {
    if !(scene_radius.is_normal() && scene_radius > 0.0) {
        return LineTracksResult::default();
    }
    let mut clock = StepClock::new();
    let mut report = LineTracksReport::default();
    let min_views = config.min_views.max(2);
    let views: Vec<TrackView> = observations
        .par_iter()
        .map(|observation| {
            TrackView::new(
                observation,
                scene_radius.recip(),
                config.min_segment_length_in_pixels,
            )
        })
        .collect();
    report.usable_views = views.iter().filter(|v| !v.segments.is_empty()).count();
    report.usable_segments = views.iter().map(|v| v.segments.len()).sum();
    let neighbours = neighbours::neighbours(&views, config.ball_margin, &config.neighbours);
    report.neighbour_pairs = neighbours.iter().map(Vec::len).sum();
    let priors = depth_priors(&views, priors, scene_radius.recip());
    report.usable_priors = priors.len();
    clock.end_of("preparation");

    let alternatives = score_hypotheses(
        &views,
        &neighbours,
        &priors,
        config.ball_margin,
        min_views,
        &config.matching,
        &config.scoring,
    );
    report.segments_with_hypotheses = alternatives
        .iter()
        .flatten()
        .filter(|list| !list.is_empty())
        .count();
    clock.end_of("matching");

    let consensus = find_consensus(&views, &alternatives, min_views, &config.consensus);
    drop(alternatives);
    report.segments_in_consensus = consensus.iter().flatten().flatten().count();
    clock.end_of("consensus");

    let tracks = grow_tracks(
        &views,
        &consensus,
        min_views,
        &config.clustering,
        &config.refinement,
    );
    report.grown_tracks = tracks.len();
    clock.end_of("tracks");

    let merge = |tracks| {
        merge_duplicates(
            &views,
            tracks,
            min_views,
            &config.merging,
            &config.refinement,
        )
    };
    let tracks = merge(tracks);
    let tracks = gather_unclaimed(
        &views,
        tracks,
        min_views,
        &config.clustering,
        &config.refinement,
    );
    let tracks = merge(tracks);
    report.merged_tracks = tracks.len();
    clock.end_of("merging");

    let mut graph = junction_graph(&views, &tracks, min_views, &config.junctions);
    dissolve_straight(&views, &mut graph, &config.straight);
    report.graph_edges = graph.edges.len();
    clock.end_of("junctions");

    adjust_graph(&views, &mut graph, &config.adjustment);
    confirm_edges(
        &views,
        &mut graph,
        min_views,
        &config.clustering,
        &config.confirmation,
    );
    report.confirmed_edges = graph.edges.len();
    drop_isolated(&views, &mut graph, min_views, &config.isolation);
    report.accompanied_edges = graph.edges.len();
    clock.end_of("adjustment");

    let noise = noise_in_pixels(&views, &graph);
    let merged = merge_parallel(&views, &mut graph, noise, &config.parallel);
    report.dropped_copies = merged.copies;
    report.merged_pieces = merged.pieces;
    let joined = join_free_ends(
        &views,
        &mut graph,
        noise,
        &config.refinement,
        &config.free_ends,
    );
    report.joined_corners = joined.corners;
    report.attached_ends = joined.attached;
    report.ends_on_edges = joined.on_edges.len();
    let crossings = add_crossings(
        &views,
        &mut graph,
        noise,
        &config.refinement,
        &config.splitting,
    );
    report.crossings = crossings.len() / 2;
    report.split_edges = split_edges(
        &views,
        &mut graph,
        &[joined.on_edges, crossings].concat(),
        min_views,
        noise,
        &config.refinement,
        &config.splitting,
    );
    clock.end_of("ends");

    let mut visible = None;
    if let (true, Some(surface)) = (config.occlusion_test, surface) {
        let surface = UnitBallSurface {
            surface,
            scene_radius,
        };
        visible = Some(drop_occluded(
            observations,
            &mut graph,
            &surface,
            scene_radius,
            config,
        ));
        clock.end_of("occlusion");
    }
    report.unoccluded_edges = graph.edges.len();
    result(&views, graph, visible, scene_radius, report, clock.timings)
}

/// Measures the steps.
struct StepClock {
    last: Instant,
    timings: Vec<StepTiming>,
}

impl StepClock {
    fn new() -> Self {
        Self {
            last: Instant::now(),
            timings: Vec::new(),
        }
    }

    fn end_of(&mut self, step: &'static str) {
        let now = Instant::now();
        self.timings.push(StepTiming {
            step,
            duration: now - self.last,
        });
        self.last = now;
    }
}

/// The proposals as depths on the rays of their segments, by ascending id; of
/// several for one segment the first.
fn depth_priors(views: &[TrackView], proposals: &[SegmentProposal], scale: f64) -> Vec<DepthPrior> {
    let mut priors: Vec<DepthPrior> = proposals
        .iter()
        .filter_map(|proposal| {
            let view = views.get(proposal.view)?;
            // Segments keep their order.
            let segment = view
                .segments
                .binary_search_by_key(&proposal.segment_in_view, |s| s.segment_in_view)
                .ok()?;
            let ends = proposal.segment.ends();
            let rays = view.segments[segment].rays;
            let depths = [0, 1]
                .map(|side| (ends[side] * scale - view.camera.center_in_world).dot(&rays[side]));
            let spreads = proposal.end_spread.map(|spread| spread * scale);
            let usable = depths.iter().all(|d| d.is_finite() && *d > 0.0)
                && spreads.iter().all(|s| s.is_finite() && *s >= 0.0);
            usable.then_some(DepthPrior {
                id: SegmentId {
                    view: proposal.view,
                    segment,
                },
                depths,
                spreads,
            })
        })
        .collect();
    priors.sort_by_key(|prior| prior.id);
    priors.dedup_by_key(|prior| prior.id);
    priors
}

/// Drops the edges that the images ought to show more often; returns the number
/// of views in which each of the others is visible.
fn drop_occluded(
    observations: &[ViewObservation],
    graph: &mut JunctionGraph,
    surface: &UnitBallSurface,
    scene_radius: f64,
    config: &LineTracksConfig,
) -> Vec<usize> {
    let views: Vec<ViewObservation> = observations
        .iter()
        .filter(|observation| observation.camera.validate().is_ok())
        .map(|observation| {
            let mut camera = observation.camera;
            camera.center_in_world /= scene_radius;
            ViewObservation {
                camera,
                segments: Vec::new(),
                junctions: Vec::new(),
            }
        })
        .collect();
    let pairs: Vec<[usize; 2]> = graph.edges.iter().map(|edge| edge.junctions).collect();
    let visible = visible_views(&views, &graph.junctions, &pairs, surface, &config.occlusion);
    let edges = std::mem::take(&mut graph.edges);
    let mut kept_visible = Vec::new();
    for (edge, visible) in edges.into_iter().zip(visible) {
        let support = view_count(&edge.supports);
        let ratio = config
            .occlusion
            .support_ratio(support, visible, views.len());
        if ratio >= config.occlusion.min_support_ratio {
            graph.edges.push(edge);
            kept_visible.push(visible);
        }
    }
    kept_visible
}

/// The graph without isolated junctions, in canonical order and in the world of
/// the observations.
fn result(
    views: &[TrackView],
    graph: JunctionGraph,
    visible: Option<Vec<usize>>,
    scene_radius: f64,
    mut report: LineTracksReport,
    timings: Vec<StepTiming>,
) -> LineTracksResult {
    let mut order: Vec<usize> = graph.edges.iter().flat_map(|edge| edge.junctions).collect();
    order.sort_unstable();
    order.dedup();
    order.sort_by(|a, b| {
        let [a, b] = [a, b].map(|junction| &graph.junctions[*junction]);
        a.x.total_cmp(&b.x)
            .then(a.y.total_cmp(&b.y))
            .then(a.z.total_cmp(&b.z))
    });
    let mut new_index = vec![0; graph.junctions.len()];
    for (new, old) in order.iter().enumerate() {
        new_index[*old] = new;
    }
    let mut edges: Vec<([usize; 2], LineEvidence)> = graph
        .edges
        .iter()
        .enumerate()
        .map(|(i, edge)| {
            let [a, b] = edge.junctions.map(|junction| new_index[junction]);
            let visible_views = visible.as_ref().map(|visible| visible[i]);
            ([a.min(b), a.max(b)], evidence(views, edge, visible_views))
        })
        .collect();
    edges.sort_by_key(|(pair, _)| *pair);
    report.junctions = order.len();
    report.edges = edges.len();
    let (pairs, evidence) = edges.into_iter().unzip();
    LineTracksResult {
        wireframe: Wireframe3d {
            junctions: order
                .iter()
                .map(|old| graph.junctions[*old] * scene_radius)
                .collect(),
            edges: pairs,
        },
        edges: evidence,
        report,
        timings,
    }
}

fn evidence(views: &[TrackView], edge: &GraphEdge, visible_views: Option<usize>) -> LineEvidence {
    LineEvidence {
        supports: edge
            .supports
            .iter()
            .map(|id| SegmentSupport {
                view: id.view,
                segment_in_view: segment_of(views, *id).segment_in_view,
            })
            .collect(),
        views: view_count(&edge.supports),
        visible_views,
    }
}
