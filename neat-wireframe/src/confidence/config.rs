//! Settings of the assessment.

use serde::{Deserialize, Serialize};

/// What of [`super::assess`] there is a reason to change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConfidenceConfig {
    /// Both ends of a supporting segment lie this near to the projected edge's
    /// line.
    pub tolerance_in_pixels: f64,
    /// A view shows an edge if its segments cover this share of what of the edge
    /// lies in the image.
    pub min_covered_share: f64,
    /// What is taken for the noise of a detector where too few observations tell.
    pub usual_noise_in_pixels: f64,
    /// A junction is not determined if its largest standard deviation exceeds this
    /// share of the scene radius.
    pub max_relative_sigma: f64,
    /// Share of the edges that is expected to be true before any is looked at.
    pub prior: f64,
    /// Share of the views that show a true edge, before any is looked at; counts
    /// as much as ten views.
    pub usual_detection_rate: f64,
}

impl Default for ConfidenceConfig {
    fn default() -> Self {
        Self {
            tolerance_in_pixels: 4.0,
            min_covered_share: 0.5,
            usual_noise_in_pixels: 0.7,
            max_relative_sigma: 0.1,
            prior: 0.8,
            usual_detection_rate: 0.6,
        }
    }
}

impl ConfidenceConfig {
    pub(super) fn provenance(&self) -> ProvenanceConfig {
        ProvenanceConfig {
            tolerance_in_pixels: self.tolerance_in_pixels,
            min_covered_share: self.min_covered_share,
            ..Default::default()
        }
    }

    pub(super) fn covariance(&self) -> CovarianceConfig {
        CovarianceConfig {
            usual_noise_in_pixels: self.usual_noise_in_pixels,
            max_relative_sigma: self.max_relative_sigma,
            ..Default::default()
        }
    }

    pub(super) fn existence(&self) -> ExistenceConfig {
        ExistenceConfig {
            prior: self.prior,
            usual_detection_rate: self.usual_detection_rate,
            ..Default::default()
        }
    }
}

/// Which 2D segments support an edge, and which views ought to show it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ProvenanceConfig {
    /// Both ends of a supporting segment lie this near to the projected edge's
    /// line …
    pub tolerance_in_pixels: f64,
    /// … under at most this angle to it …
    pub max_angle_in_degrees: f64,
    /// … or, because the ends of short segments are noisy, with at most this
    /// difference between the distances of both ends.
    pub max_tilt_in_pixels: f64,
    /// The common part is at least this share of the shorter of the two.
    pub min_overlap: f64,
    /// Edges that appear shorter than this are not looked for.
    pub min_projected_length_in_pixels: f64,
    /// A view shows an edge if its segments cover this share of what of the edge
    /// lies in the image.
    pub min_covered_share: f64,
}

impl Default for ProvenanceConfig {
    fn default() -> Self {
        Self {
            tolerance_in_pixels: 4.0,
            max_angle_in_degrees: 5.0,
            max_tilt_in_pixels: 2.0,
            min_overlap: 0.5,
            min_projected_length_in_pixels: 8.0,
            min_covered_share: 0.5,
        }
    }
}

/// What the 2D segments say about positions.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CovarianceConfig {
    /// An end of a supporting segment shows the edge's junction if it lies this
    /// near to its projection; farther ends lie anywhere on the edge. Generous,
    /// because a narrow limit would cut off the noise that it is to measure.
    pub max_end_distance_in_pixels: f64,
    /// The same limit as a share of the segment's length.
    pub max_relative_end_distance: f64,
    /// Observations beyond this many standard deviations are errors, not noise.
    pub max_standard_deviations: f64,
    /// The noise of a detector is never taken for less than this.
    pub min_noise_in_pixels: f64,
    /// What is taken for the noise where too few observations tell.
    pub usual_noise_in_pixels: f64,
    /// Gauss–Newton steps at most.
    pub max_iterations: usize,
    /// The noise around one junction counts as many observations of its own as it
    /// has, that of the scene as this many.
    pub prior_degrees_of_freedom: f64,
    /// A junction is not determined if its largest standard deviation exceeds this
    /// share of the scene radius …
    pub max_relative_sigma: f64,
    /// … or if fewer views show it.
    pub min_views: usize,
}

impl Default for CovarianceConfig {
    fn default() -> Self {
        Self {
            max_end_distance_in_pixels: 8.0,
            max_relative_end_distance: 0.4,
            max_standard_deviations: 4.0,
            min_noise_in_pixels: 0.05,
            usual_noise_in_pixels: 0.7,
            max_iterations: 6,
            prior_degrees_of_freedom: 20.0,
            max_relative_sigma: 0.1,
            min_views: 2,
        }
    }
}

/// What speaks for the existence of an edge.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ExistenceConfig {
    /// Share of the edges that is expected to be true before any is looked at …
    pub prior: f64,
    /// … which counts as much as this many edges of the scene.
    pub prior_weight: f64,
    /// Share of the views that show a true edge, before any is looked at; counts
    /// as much as ten views.
    pub usual_detection_rate: f64,
    /// At most this many random lines tell how often chance supports an edge.
    pub max_decoys: usize,
    /// Chance supports an edge in at least this share of the views.
    pub min_coincidence_rate: f64,
    /// What is seen nowhere has no evidence either: an edge counts as expected in at
    /// least this share of the views …
    pub min_expected_share: f64,
    /// … or this number of them, whichever is less.
    pub min_expected_views: f64,
    /// Correlation of what two views say about one edge, as bounds of its
    /// estimate. Independent views have 0.
    pub view_correlation: [f64; 2],
}

impl Default for ExistenceConfig {
    fn default() -> Self {
        Self {
            prior: 0.8,
            prior_weight: 5.0,
            usual_detection_rate: 0.6,
            max_decoys: 256,
            min_coincidence_rate: 0.01,
            min_expected_share: 0.2,
            min_expected_views: 20.0,
            view_correlation: [0.05, 0.5],
        }
    }
}

impl ExistenceConfig {
    /// The number of views out of `views` in which every edge counts as expected.
    pub(super) fn least_expected_views(&self, views: usize) -> usize {
        let share = self.min_expected_share.min(1.0) * views as f64;
        // Saturating: a negative number or none becomes 0.
        share.min(self.min_expected_views).round() as usize
    }
}
