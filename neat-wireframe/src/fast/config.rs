//! Configuration of the fast back end.

use serde::{Deserialize, Serialize};

/// Which steps of [`super::run`] take place. Their constants stand beside them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FastBackEndConfig {
    /// Take the modes of the segment ends as junctions.
    pub use_junction_modes: bool,
    /// Take the perceived junctions that segment ends support.
    pub use_perceived_junctions: bool,
    /// Re-estimate the junctions from the 2D ends.
    pub retriangulation: bool,
    /// Split junctions that the images tell apart.
    pub junction_splitting: bool,
    /// Test all pairs of junctions as edges; off: those that proposals suggest.
    pub edge_completion: bool,
    /// Count every detection for the edge that it fits best, not for all.
    pub exclusive_support: bool,
    /// Move all junctions until the projected edges lie on the detections.
    pub bundle_adjustment: bool,
    /// Drop edges supported in too few of the views in which they are visible.
    pub occlusion_test: bool,
    /// Merge near junctions and collinear edges, drop isolated junctions.
    pub cleanup: bool,
    /// Split edges where others end on them or cross them.
    pub edge_splitting: bool,
}

impl Default for FastBackEndConfig {
    fn default() -> Self {
        Self {
            use_junction_modes: true,
            use_perceived_junctions: true,
            retriangulation: true,
            junction_splitting: true,
            edge_completion: true,
            exclusive_support: true,
            bundle_adjustment: true,
            occlusion_test: true,
            cleanup: true,
            edge_splitting: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_configuration_names_only_what_it_changes_and_nothing_unknown() {
        let config: FastBackEndConfig = serde_json::from_str(r#"{"cleanup": false}"#).unwrap();
        let expected = FastBackEndConfig {
            cleanup: false,
            ..Default::default()
        };
        assert_eq!(config, expected);
        let text = serde_json::to_string(&config).unwrap();
        let again: FastBackEndConfig = serde_json::from_str(&text).unwrap();
        assert_eq!(again, config);
        for unknown in [r#"{"clean": true}"#, r#"{"support": {"pixels": 4.0}}"#] {
            assert!(serde_json::from_str::<FastBackEndConfig>(unknown).is_err());
        }
    }
}
