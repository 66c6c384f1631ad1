//! Configuration of the line-track back end.

use serde::{Deserialize, Serialize};

/// What of [`super::run`] there is a reason to change. The constants of its steps
/// stand beside them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LineTracksConfig {
    /// Views that must show an edge, at least 2.
    pub min_views: usize,
    /// Shorter 2D segments are passed over.
    pub min_segment_length_in_pixels: f64,
    /// Structure lies within the scene ball times this.
    pub ball_margin: f64,
    /// Views that each view is compared with, at most.
    pub neighbours: usize,
    /// What a proposal of the field that fully agrees adds, where a view adds 1.
    pub prior_weight: f64,
    /// Drop edges that are copies of others, and merge pieces.
    pub parallel_edges: bool,
    /// Join free ends with what they meet.
    pub free_ends: bool,
    /// Edges that cross on the inside of both share a junction.
    pub edge_crossings: bool,
    /// Junctions on the inside of an edge cut it.
    pub edge_splitting: bool,
    /// Drop edges supported in too few of the views in which the surface leaves
    /// them visible; without a surface it says nothing.
    pub occlusion_test: bool,
}

impl Default for LineTracksConfig {
    fn default() -> Self {
        Self {
            min_views: 3,
            min_segment_length_in_pixels: 8.0,
            ball_margin: 1.5,
            neighbours: 10,
            prior_weight: 1.0,
            parallel_edges: true,
            free_ends: true,
            edge_crossings: true,
            edge_splitting: true,
            occlusion_test: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_configuration_names_only_what_it_changes_and_nothing_unknown() {
        let text = r#"{"min_views": 4, "neighbours": 12}"#;
        let config: LineTracksConfig = serde_json::from_str(text).unwrap();
        let expected = LineTracksConfig {
            min_views: 4,
            neighbours: 12,
            ..Default::default()
        };
        assert_eq!(config, expected);
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(
            serde_json::from_str::<LineTracksConfig>(&text).unwrap(),
            config
        );
        assert!(serde_json::from_str::<LineTracksConfig>(r#"{"min_view": 4}"#).is_err());
    }
}
