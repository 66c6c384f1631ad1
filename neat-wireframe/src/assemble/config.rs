//! Configuration of the assembler.

use serde::{Deserialize, Serialize};

/// What of [`super::assemble`] there is a reason to change. The constants of its steps
/// stand beside them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AssembleConfig {
    /// Whether lines move the poses, where two halves of them agree that the poses are off.
    pub refine_poses: bool,
    /// Edges are left out that are creases or boundaries with less than this probability: paint,
    /// joints and shadows; 0 keeps all. One edge more raises F, the mean of precision and recall,
    /// if it is true with more than half of F, which is about two thirds on photographs.
    pub min_structure: f64,
    /// Evidence that an edge needs beyond what its own position takes, in nats: the
    /// logarithm of how much likelier the images are with it than without it. Lines that views
    /// propose need as much where fifteen do with ten neighbours each or more, and with fewer
    /// less.
    pub min_evidence: f64,
    /// Shorter 2D segments propose no line.
    pub min_segment_length_in_pixels: f64,
    /// Structure lies within the scene ball times this.
    pub ball_margin: f64,
    /// Views that each view is compared with, at most.
    pub neighbours: usize,
}

/// Pairs of views that propose lines in the scene with the fewest views of those that
/// [`AssembleConfig::min_evidence`] was chosen on: fifteen with ten neighbours each. With more
/// pairs more evidence brings nothing.
const FEWEST_PAIRS: f64 = 150.0;

impl AssembleConfig {
    /// Evidence that a line needs which some pair of `views` proposes, in nats: each pair has
    /// its share of wrong proposals, while the edges of a scene do not become more.
    pub(super) fn evidence_of_proposal(&self, views: usize) -> f64 {
        let neighbours = views.saturating_sub(1).min(self.neighbours);
        let pairs = (views * neighbours).max(1) as f64;
        // Where the images say no, there is no line.
        (self.min_evidence + (pairs / FEWEST_PAIRS).ln().min(0.0)).max(0.0)
    }
}

impl Default for AssembleConfig {
    fn default() -> Self {
        Self {
            refine_poses: true,
            min_structure: 0.33,
            min_evidence: 3.0,
            min_segment_length_in_pixels: 8.0,
            ball_margin: 1.5,
            neighbours: 10,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_configuration_names_only_what_it_changes_and_nothing_unknown() {
        let text = r#"{"min_evidence": 4.0, "neighbours": 12}"#;
        let config: AssembleConfig = serde_json::from_str(text).unwrap();
        let expected = AssembleConfig {
            min_evidence: 4.0,
            neighbours: 12,
            ..Default::default()
        };
        assert_eq!(config, expected);
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(
            serde_json::from_str::<AssembleConfig>(&text).unwrap(),
            config
        );
        assert!(serde_json::from_str::<AssembleConfig>(r#"{"min_view": 4}"#).is_err());
    }

    #[test]
    fn fewer_views_need_less_evidence_and_never_evidence_to_the_contrary() {
        let config = AssembleConfig::default();
        let of = |views| config.evidence_of_proposal(views);
        assert_eq!([of(15), of(400)], [config.min_evidence; 2]);
        assert!((of(10) - (config.min_evidence + 0.6f64.ln())).abs() < 1e-12);
        assert!(of(4) < of(8) && of(8) < of(10));
        assert_eq!([of(0), of(2)], [0.0; 2]);
    }
}
