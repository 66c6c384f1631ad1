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
//! origin; thresholds are pixels of the images. They are constants beside their use;
//! unless a comment says so, none has been measured on its own.

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

pub use config::LineTracksConfig;
pub use line3d::{Line3dConfig, Line3dSegment, line3d, wireframe_of_segments};
pub use report::{LineEvidence, LineTracksReport, LineTracksResult, SegmentSupport};

use crate::evidence::occlusion::{OcclusionConfig, visible_views};
use crate::signed_distance::UnitBallSurface;
use crate::{SegmentProposal, SignedDistance, ViewObservation, Wireframe3d};
use clustering::{Track, grow_tracks, view_count};
use consensus::find_consensus;
use edge_confirmation::confirm_edges;
use edge_crossings::add_crossings;
use edge_splitting::split_edges;
use free_ends::join_free_ends;
use graph_adjustment::{adjust_graph, noise_in_pixels};
use hypothesis_scoring::{DepthPrior, Scoring, score_hypotheses};
use isolated_edges::drop_isolated;
use junction_graph::{GraphEdge, JunctionGraph, junction_graph};
use line_refinement::LineRefinementConfig;
use parallel_edges::merge_parallel;
use rayon::prelude::*;
use straight_junctions::dissolve_straight;
use tracing::debug;
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
/// radius that is not a positive number. It does not depend on the number of threads.
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
    let _span = tracing::debug_span!("line_tracks", views = observations.len()).entered();
    let views: Vec<TrackView> = observations
        .par_iter()
        .map(|observation| {
            let length = config.min_segment_length_in_pixels;
            TrackView::new(observation, scene_radius.recip(), length)
        })
        .collect();
    let mut steps = Steps {
        views: &views,
        min_views: config.min_views.max(2),
        refinement: LineRefinementConfig::default(),
        config,
        report: LineTracksReport::default(),
    };
    let tracks = steps.tracks(&depth_priors(&views, priors, scene_radius.recip()));
    let mut graph = steps.graph(&tracks);
    steps.ends(&mut graph);
    let visible = surface.filter(|_| config.occlusion_test).map(|surface| {
        let surface = UnitBallSurface {
            surface,
            scene_radius,
        };
        drop_occluded(observations, &mut graph, &surface, scene_radius)
    });
    steps.report.unoccluded_edges = graph.edges.len();
    result(&views, graph, visible, scene_radius, steps.report)
}

/// One run: what all steps need, and what they report.
struct Steps<'a> {
    views: &'a [TrackView],
    min_views: usize,
    refinement: LineRefinementConfig,
    config: &'a LineTracksConfig,
    report: LineTracksReport,
}

impl Steps<'_> {
    /// Segments of several views on one line.
    fn tracks(&mut self, priors: &[DepthPrior]) -> Vec<Track> {
        let (views, min_views, config) = (self.views, self.min_views, self.config);
        let (refinement, report) = (&self.refinement, &mut self.report);
        report.usable_views = views.iter().filter(|v| !v.segments.is_empty()).count();
        report.usable_segments = views.iter().map(|v| v.segments.len()).sum();
        report.usable_priors = priors.len();
        let neighbours = neighbours::neighbours(views, config.ball_margin, config.neighbours);
        report.neighbour_pairs = neighbours.iter().map(Vec::len).sum();
        debug!(
            views = report.usable_views,
            segments = report.usable_segments,
            pairs = report.neighbour_pairs,
            priors = report.usable_priors,
            "prepared"
        );

        let scoring = Scoring {
            prior_weight: config.prior_weight,
            ..Default::default()
        };
        let margin = config.ball_margin;
        let alternatives =
            score_hypotheses(views, &neighbours, priors, margin, min_views, &scoring);
        let lists = alternatives.iter().flatten();
        report.segments_with_hypotheses = lists.filter(|list| !list.is_empty()).count();
        debug!(segments = report.segments_with_hypotheses, "matched");

        let consensus = find_consensus(views, &alternatives, min_views);
        drop(alternatives);
        report.segments_in_consensus = consensus.iter().flatten().flatten().count();
        debug!(segments = report.segments_in_consensus, "in consensus");

        let tracks = grow_tracks(views, &consensus, min_views, refinement);
        report.grown_tracks = tracks.len();
        let tracks = merge_duplicates(views, tracks, min_views, refinement);
        let tracks = gather_unclaimed(views, tracks, min_views, refinement);
        let tracks = merge_duplicates(views, tracks, min_views, refinement);
        report.merged_tracks = tracks.len();
        debug!(
            grown = report.grown_tracks,
            merged = report.merged_tracks,
            "tracks"
        );
        tracks
    }

    /// The tracks joined where 2D vertices join them, adjusted, without edges that
    /// the images do not confirm.
    fn graph(&mut self, tracks: &[Track]) -> JunctionGraph {
        let (views, min_views, report) = (self.views, self.min_views, &mut self.report);
        let mut graph = junction_graph(views, tracks, min_views);
        dissolve_straight(views, &mut graph);
        report.graph_edges = graph.edges.len();
        adjust_graph(views, &mut graph);
        confirm_edges(views, &mut graph, min_views);
        report.confirmed_edges = graph.edges.len();
        drop_isolated(views, &mut graph, min_views);
        report.accompanied_edges = graph.edges.len();
        debug!(
            edges = report.graph_edges,
            confirmed = report.confirmed_edges,
            accompanied = report.accompanied_edges,
            "graph"
        );
        graph
    }

    /// Edges become one, free ends meet something, edges are cut where others end
    /// on or cross them.
    fn ends(&mut self, graph: &mut JunctionGraph) {
        let (views, config, report) = (self.views, self.config, &mut self.report);
        let noise = noise_in_pixels(views, graph);
        if config.parallel_edges {
            let merged = merge_parallel(views, graph, noise);
            report.dropped_copies = merged.copies;
            report.merged_pieces = merged.pieces;
        }
        let mut splits = Vec::new();
        if config.free_ends {
            let joined = join_free_ends(views, graph, noise, &self.refinement);
            report.joined_corners = joined.corners;
            report.attached_ends = joined.attached;
            report.ends_on_edges = joined.on_edges.len();
            splits = joined.on_edges;
        }
        if config.edge_crossings {
            let crossings = add_crossings(views, graph, noise, &self.refinement);
            report.crossings = crossings.len() / 2;
            splits.extend(crossings);
        }
        if config.edge_splitting {
            let refinement = &self.refinement;
            report.split_edges =
                split_edges(views, graph, &splits, self.min_views, noise, refinement);
        }
        debug!(
            noise_in_pixels = noise,
            copies = report.dropped_copies,
            pieces = report.merged_pieces,
            corners = report.joined_corners,
            attached = report.attached_ends,
            on_edges = report.ends_on_edges,
            crossings = report.crossings,
            split = report.split_edges,
            "ends"
        );
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
) -> Vec<usize> {
    let config = OcclusionConfig::default();
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
    let visible = visible_views(&views, &graph.junctions, &pairs, surface, &config);
    let edges = std::mem::take(&mut graph.edges);
    let mut kept_visible = Vec::new();
    for (edge, visible) in edges.into_iter().zip(visible) {
        let support = view_count(&edge.supports);
        let ratio = config.support_ratio(support, visible, views.len());
        if ratio >= config.min_support_ratio {
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
