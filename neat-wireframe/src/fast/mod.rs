//! The fast back end: from segment proposals to a wireframe graph that the 2D
//! evidence of all views confirms.
//!
//! Where the paper's distillation (NEAT, Sec. 4.3) takes positions from the field,
//! this one takes only neighbourhoods: an end within about 0.05 of a junction is
//! enough. Positions come from triangulation and bundle adjustment of the 2D
//! detections, edges from the pairs of junctions that detections join, precision
//! from the surface, which tells where an edge ought to be seen.
//!
//! All steps work in a world whose scene ball is the unit ball around the
//! origin, so every length among the constants is a share of the scene's radius. The
//! constants stand beside their use; unless a comment says so, none has been
//! measured on its own.

mod attraction_hypotheses;
mod cleanup;
mod config;
mod edge_completion;
mod exclusive_support;
mod junction_modes;
mod junction_splitting;
mod report;
mod step_report;
mod touching_edges;
mod usable_input;

pub use crate::segment_ends::SegmentEnd;
pub use config::FastBackEndConfig;
pub use junction_modes::junction_modes;
pub use report::{EdgeEvidence, FastBackEndReport, FastBackEndResult};
pub use step_report::{Step, StepChange};

use crate::bundle_adjustment::{BundleAdjustmentConfig, bundle_adjust};
use crate::evidence::edge_support::{SupportedEdge, required_views};
use crate::evidence::occlusion::{OcclusionConfig, visible_views};
use crate::segment_ends::segment_ends;
use crate::signed_distance::UnitBallSurface;
use crate::triangulation::{TriangulationConfig, associate, retriangulate};
use crate::{SegmentProposal, SignedDistance, ViewObservation};
use attraction_hypotheses::attraction_hypotheses;
use cleanup::clean_up;
use edge_completion::complete_edges;
use exclusive_support::exclusively_supported;
use junction_modes::supported_junctions;
use junction_splitting::{SplitJunctions, split_junctions};
use nalgebra::Vector3;
use neat_core::Wireframe3d;
use step_report::GraphSize;
use touching_edges::split_touching_edges;
use tracing::debug;
use usable_input::UsableInput;

/// Builds the wireframe.
///
/// - `observations`: cameras and detected segments. Views without a finite
///   camera or segment do not count.
/// - `proposals`: 3D segments with indices into `observations`; those that are
///   not finite or name nothing do not count.
/// - `perceived_junctions`: further candidates, from global junction perceiving.
/// - `surface`: asked for distances in the world of the cameras.
/// - `scene_radius`: radius of the ball around the world's origin in which
///   `surface` means something.
///
/// The result is empty where nothing can be built: no usable proposals, a
/// radius that is not a positive number. It does not depend on the number of
/// threads.
pub fn run(
    observations: &[ViewObservation],
    proposals: &[SegmentProposal],
    perceived_junctions: &[Vector3<f64>],
    surface: &dyn SignedDistance,
    scene_radius: f64,
    config: &FastBackEndConfig,
) -> FastBackEndResult {
    run_observed(
        observations,
        proposals,
        perceived_junctions,
        surface,
        scene_radius,
        config,
        &mut |_| {},
    )
}

/// [`run`] that tells `on_step` of every step as soon as it is done.
pub fn run_observed(
    observations: &[ViewObservation],
    proposals: &[SegmentProposal],
    perceived_junctions: &[Vector3<f64>],
    surface: &dyn SignedDistance,
    scene_radius: f64,
    config: &FastBackEndConfig,
    on_step: &mut dyn FnMut(&StepChange),
) -> FastBackEndResult {
    if !(scene_radius.is_normal() && scene_radius > 0.0) {
        return FastBackEndResult::default();
    }
    let _span = tracing::debug_span!("fast", views = observations.len()).entered();
    let UsableInput { views, proposals } =
        UsableInput::new(observations, proposals, scene_radius.recip());
    debug!(
        views = views.len(),
        proposals = proposals.len(),
        perceived_junctions = perceived_junctions.len(),
        "usable input"
    );
    let perceived: Vec<_> = perceived_junctions
        .iter()
        .map(|junction| junction / scene_radius)
        .collect();
    let back_end = BackEnd {
        required_views: required_views(views.len()),
        surface: UnitBallSurface {
            surface,
            scene_radius,
        },
        views: &views,
        proposals: &proposals,
        triangulation: TriangulationConfig::default(),
        adjustment: BundleAdjustmentConfig::default(),
        occlusion: OcclusionConfig::default(),
        config,
    };
    let mut record = Record {
        report: FastBackEndReport {
            usable_views: views.len(),
            usable_proposals: proposals.len(),
            required_views: back_end.required_views,
            ..Default::default()
        },
        on_step,
    };
    let junctions = back_end.find_junctions(&perceived, &mut record);
    let (junctions, edges) = back_end.find_edges(junctions, &mut record);
    let (junctions, edges) = canonical_order(junctions, edges);
    let mut report = record.report;
    report.junctions = junctions.len();
    report.edges = edges.len();
    FastBackEndResult {
        wireframe: Wireframe3d {
            junctions: junctions.iter().map(|x| x * scene_radius).collect(),
            edges: edges.iter().map(|edge| edge.junctions).collect(),
        },
        edges: edges.iter().map(|edge| back_end.evidence(edge)).collect(),
        report,
    }
}

/// The growing report, and who wants to hear of it.
struct Record<'a> {
    report: FastBackEndReport,
    on_step: &'a mut dyn FnMut(&StepChange),
}

impl Record<'_> {
    fn push(&mut self, step: StepChange) {
        debug!(
            step = ?step.step,
            junctions = step.junctions,
            edges = step.edges,
            added_junctions = step.added_junctions,
            removed_junctions = step.removed_junctions,
            added_edges = step.added_edges,
            removed_edges = step.removed_edges,
        );
        (self.on_step)(&step);
        self.report.steps.push(step);
    }

    /// A step on junctions that have no edges yet.
    fn push_junctions(&mut self, step: Step, before: usize, after: usize) {
        let [before, after] = [before, after].map(|junctions| GraphSize {
            junctions,
            edges: 0,
        });
        self.push(StepChange::from_sizes(step, before, after));
    }

    /// A step that chose edges anew.
    fn push_edges(
        &mut self,
        step: Step,
        junctions: usize,
        before: &[SupportedEdge],
        after: &[SupportedEdge],
    ) {
        let [before, after] = [before, after].map(pairs_of);
        self.push(StepChange::from_edges(step, junctions, &before, &after));
    }
}

/// The usable input of one run.
struct BackEnd<'a> {
    views: &'a [ViewObservation],
    proposals: &'a [SegmentProposal],
    surface: UnitBallSurface<'a>,
    required_views: usize,
    triangulation: TriangulationConfig,
    adjustment: BundleAdjustmentConfig,
    occlusion: OcclusionConfig,
    config: &'a FastBackEndConfig,
}

impl BackEnd<'_> {
    /// Candidates from the proposals' ends, re-triangulated.
    fn find_junctions(&self, perceived: &[Vector3<f64>], record: &mut Record) -> SplitJunctions {
        let config = self.config;
        let ends = segment_ends(self.views, self.proposals);
        record.report.segment_ends = ends.len();

        let mut junctions = Vec::new();
        if config.use_junction_modes {
            junctions = junction_modes(&ends);
            record.push_junctions(Step::JunctionModes, 0, junctions.len());
        }
        record.report.junction_modes = junctions.len();
        if config.use_perceived_junctions {
            let before = junctions.len();
            let added = supported_junctions(perceived, &ends, &junctions);
            record.report.added_perceived_junctions = added.len();
            junctions.extend(added);
            record.push_junctions(Step::PerceivedJunctions, before, junctions.len());
        }
        if config.retriangulation {
            let before = junctions.len();
            junctions = retriangulate(
                &junctions,
                &ends,
                self.views,
                self.required_views,
                &self.triangulation,
            );
            record.push_junctions(Step::Retriangulation, before, junctions.len());
        }
        record.report.triangulated_junctions = junctions.len();
        let mut split = SplitJunctions {
            junctions,
            ..SplitJunctions::default()
        };
        if let (true, Some(round)) = (config.junction_splitting, self.triangulation.rounds.first())
        {
            let before = split.junctions.len();
            let observations = associate(&split.junctions, &ends, self.views, round);
            split = split_junctions(
                &split.junctions,
                &observations,
                self.views,
                self.required_views,
                &self.triangulation,
            );
            let after = split.junctions.len();
            record.report.split_junctions = after - before;
            record.push_junctions(Step::JunctionSplitting, before, after);
        }
        split
    }

    /// The edges that the evidence confirms, with the junctions where it puts
    /// them.
    fn find_edges(
        &self,
        SplitJunctions {
            mut junctions,
            told_apart,
        }: SplitJunctions,
        record: &mut Record,
    ) -> (Vec<Vector3<f64>>, Vec<SupportedEdge>) {
        let config = self.config;
        let hypotheses =
            (!config.edge_completion).then(|| attraction_hypotheses(&junctions, self.proposals));
        let mut edges = self.supported_edges(&junctions, hypotheses.as_deref());
        record.report.supported_edges = edges.len();
        record.push_edges(Step::Edges, junctions.len(), &[], &edges);

        if config.bundle_adjustment {
            for association in &self.adjustment.association_in_pixels {
                junctions = self.adjust(&junctions, &edges, *association);
            }
            record.push_edges(Step::BundleAdjustment, junctions.len(), &edges, &edges);
            // Junctions have moved: pairs that just failed may pass now, and the
            // other way round.
            let chosen = self.supported_edges(&junctions, hypotheses.as_deref());
            record.push_edges(Step::EdgesAfterAdjustment, junctions.len(), &edges, &chosen);
            edges = chosen;
        }
        record.report.supported_edges_after_adjustment = edges.len();

        if config.occlusion_test {
            let unoccluded = self.unoccluded(&junctions, &edges);
            record.push_edges(Step::OcclusionTest, junctions.len(), &edges, &unoccluded);
            edges = unoccluded;
        }
        record.report.unoccluded_edges = edges.len();

        if config.cleanup {
            let before = size_of(&junctions, &edges);
            (junctions, edges) = clean_up(&junctions, &edges, &told_apart);
            let after = size_of(&junctions, &edges);
            record.push(StepChange::from_sizes(Step::CleanUp, before, after));
        }
        if config.bundle_adjustment {
            let association = self.adjustment.final_association_in_pixels;
            junctions = self.adjust(&junctions, &edges, association);
            record.push_edges(Step::FinalAdjustment, junctions.len(), &edges, &edges);
        }
        if config.edge_splitting {
            let before = size_of(&junctions, &edges);
            (junctions, edges) = split_touching_edges(&junctions, &edges);
            let after = size_of(&junctions, &edges);
            record.push(StepChange::from_sizes(Step::EdgeSplitting, before, after));
        }
        (junctions, edges)
    }

    /// The pairs with enough support: among `hypotheses`, which are sorted, or
    /// among all.
    fn supported_edges(
        &self,
        junctions: &[Vector3<f64>],
        hypotheses: Option<&[[usize; 2]]>,
    ) -> Vec<SupportedEdge> {
        let required = self.required_views;
        let mut edges = complete_edges(self.views, junctions, required);
        if let Some(hypotheses) = hypotheses {
            edges.retain(|edge| hypotheses.binary_search(&edge.junctions).is_ok());
        }
        if self.config.exclusive_support {
            exclusively_supported(self.views, junctions, &edges, required)
        } else {
            edges
        }
    }

    fn adjust(
        &self,
        junctions: &[Vector3<f64>],
        edges: &[SupportedEdge],
        association_in_pixels: f64,
    ) -> Vec<Vector3<f64>> {
        bundle_adjust(
            self.views,
            junctions,
            &pairs_of(edges),
            association_in_pixels,
            &self.adjustment,
        )
        .junctions
    }

    /// The edges with support in enough of the views that could see them.
    fn unoccluded(
        &self,
        junctions: &[Vector3<f64>],
        edges: &[SupportedEdge],
    ) -> Vec<SupportedEdge> {
        let config = &self.occlusion;
        let visible = visible_views(
            self.views,
            junctions,
            &pairs_of(edges),
            &self.surface,
            config,
        );
        edges
            .iter()
            .zip(visible)
            .filter(|(edge, visible)| {
                config.support_ratio(edge.support, *visible, self.views.len())
                    >= config.min_support_ratio
            })
            .map(|(edge, visible)| SupportedEdge {
                visible_views: Some(visible),
                ..*edge
            })
            .collect()
    }

    fn evidence(&self, edge: &SupportedEdge) -> EdgeEvidence {
        let ratio = |visible| {
            let config = &self.occlusion;
            config.support_ratio(edge.support, visible, self.views.len())
        };
        EdgeEvidence {
            support: edge.support,
            visible_views: edge.visible_views,
            support_ratio: edge.visible_views.map(ratio),
        }
    }
}

fn size_of(junctions: &[Vector3<f64>], edges: &[SupportedEdge]) -> GraphSize {
    GraphSize {
        junctions: junctions.len(),
        edges: edges.len(),
    }
}

fn pairs_of(edges: &[SupportedEdge]) -> Vec<[usize; 2]> {
    edges.iter().map(|edge| edge.junctions).collect()
}

/// Sorts the junctions by their coordinates and the edges by their junctions.
fn canonical_order(
    junctions: Vec<Vector3<f64>>,
    mut edges: Vec<SupportedEdge>,
) -> (Vec<Vector3<f64>>, Vec<SupportedEdge>) {
    let mut order: Vec<usize> = (0..junctions.len()).collect();
    order.sort_by(|a, b| {
        let (a, b) = (&junctions[*a], &junctions[*b]);
        a.x.total_cmp(&b.x)
            .then(a.y.total_cmp(&b.y))
            .then(a.z.total_cmp(&b.z))
    });
    let mut new_index = vec![0; junctions.len()];
    for (new, old) in order.iter().enumerate() {
        new_index[*old] = new;
    }
    for edge in &mut edges {
        let [a, b] = edge.junctions.map(|junction| new_index[junction]);
        edge.junctions = [a.min(b), a.max(b)];
    }
    edges.sort_by_key(|edge| edge.junctions);
    (order.into_iter().map(|old| junctions[old]).collect(), edges)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn canonical_order_renames_the_junctions_of_the_edges() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let edge = |a, b, support| SupportedEdge {
            junctions: [a, b],
            support,
            visible_views: None,
        };
        let junctions = vec![at(1.0, 0.0), at(0.0, 1.0), at(0.0, 0.0)];
        let edges = vec![edge(0, 1, 7), edge(0, 2, 9)];
        let (junctions, edges) = canonical_order(junctions, edges);
        assert_eq!(junctions, [at(0.0, 0.0), at(0.0, 1.0), at(1.0, 0.0)]);
        assert_eq!(edges, [edge(0, 2, 9), edge(1, 2, 7)]);
    }
}
