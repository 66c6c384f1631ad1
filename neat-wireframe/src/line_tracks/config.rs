//! Configuration of the line-track back end.

use super::clustering::ClusteringConfig;
use super::consensus::ConsensusConfig;
use super::edge_confirmation::EdgeConfirmationConfig;
use super::edge_splitting::EdgeSplittingConfig;
use super::epipolar_matching::EpipolarMatchingConfig;
use super::free_ends::FreeEndsConfig;
use super::graph_adjustment::GraphAdjustmentConfig;
use super::hypothesis_scoring::HypothesisScoringConfig;
use super::isolated_edges::IsolatedEdgesConfig;
use super::junction_graph::JunctionGraphConfig;
use super::line_refinement::LineRefinementConfig;
use super::neighbours::NeighboursConfig;
use super::parallel_edges::ParallelEdgesConfig;
use super::straight_junctions::StraightJunctionsConfig;
use super::track_merging::TrackMergingConfig;
use crate::evidence::occlusion::OcclusionConfig;
use serde::{Deserialize, Serialize};

/// Switches and constants of [`super::run`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LineTracksConfig {
    /// Views that must show an edge, at least 2.
    pub min_views: usize,
    /// Shorter 2D segments are passed over.
    pub min_segment_length_in_pixels: f64,
    /// Structure lies within the scene ball times this.
    pub ball_margin: f64,
    /// Which views are compared.
    pub neighbours: NeighboursConfig,
    /// Which segments are compared.
    pub matching: EpipolarMatchingConfig,
    /// What speaks for a 3D position.
    pub scoring: HypothesisScoringConfig,
    /// How segments choose among their positions.
    pub consensus: ConsensusConfig,
    /// When a segment belongs to a track.
    pub clustering: ClusteringConfig,
    /// How a track's line is found.
    pub refinement: LineRefinementConfig,
    /// Which tracks are one.
    pub merging: TrackMergingConfig,
    /// Which ends of tracks are one junction.
    pub junctions: JunctionGraphConfig,
    /// Which junctions are none.
    pub straight: StraightJunctionsConfig,
    /// Bundle adjustment of the graph.
    pub adjustment: GraphAdjustmentConfig,
    /// The final test of every edge.
    pub confirmation: EdgeConfirmationConfig,
    /// Which edges float alone.
    pub isolation: IsolatedEdgesConfig,
    /// Which edges are copies or pieces of others.
    pub parallel: ParallelEdgesConfig,
    /// Which free ends meet something.
    pub free_ends: FreeEndsConfig,
    /// Which junctions cut an edge.
    pub splitting: EdgeSplittingConfig,
    /// Drop edges supported in too few of the views in which the surface leaves
    /// them visible; without a surface it says nothing.
    pub occlusion_test: bool,
    /// Constants of the occlusion test.
    pub occlusion: OcclusionConfig,
}

impl Default for LineTracksConfig {
    fn default() -> Self {
        Self {
            min_views: 3,
            min_segment_length_in_pixels: 8.0,
            ball_margin: 1.5,
            neighbours: NeighboursConfig::default(),
            matching: EpipolarMatchingConfig::default(),
            scoring: HypothesisScoringConfig::default(),
            consensus: ConsensusConfig::default(),
            clustering: ClusteringConfig::default(),
            refinement: LineRefinementConfig::default(),
            merging: TrackMergingConfig::default(),
            junctions: JunctionGraphConfig::default(),
            straight: StraightJunctionsConfig::default(),
            adjustment: GraphAdjustmentConfig::default(),
            confirmation: EdgeConfirmationConfig::default(),
            isolation: IsolatedEdgesConfig::default(),
            parallel: ParallelEdgesConfig::default(),
            free_ends: FreeEndsConfig::default(),
            splitting: EdgeSplittingConfig::default(),
            occlusion_test: false,
            occlusion: OcclusionConfig::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_configuration_names_only_what_it_changes_and_nothing_unknown() {
        let text = r#"{"min_views": 4, "clustering": {"tolerance_in_pixels": 1.5}}"#;
        let config: LineTracksConfig = serde_json::from_str(text).unwrap();
        let mut expected = LineTracksConfig {
            min_views: 4,
            ..Default::default()
        };
        expected.clustering.tolerance_in_pixels = 1.5;
        assert_eq!(config, expected);
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(
            serde_json::from_str::<LineTracksConfig>(&text).unwrap(),
            config
        );
        assert!(serde_json::from_str::<LineTracksConfig>(r#"{"min_view": 4}"#).is_err());
    }
}
