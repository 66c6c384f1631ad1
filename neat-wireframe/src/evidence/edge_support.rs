//! In how many views a detection confirms an edge end by end.

use neat_core::LineSegment2;
use serde::{Deserialize, Serialize};

/// When a view supports an edge, and how many views it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeSupportConfig {
    /// Both ends of a detection must be closer than this to the projected ends.
    pub max_end_distance_in_pixels: f64,
    /// The same limit as a share of the projected edge's length.
    pub max_relative_end_distance: f64,
    /// Share of the views that must support an edge …
    pub required_share_of_views: f64,
    /// … but at least this number …
    pub min_required_views: usize,
    /// … and never more than this.
    pub max_required_views: usize,
    /// Share of an edge's supporting views in which a detection must fit it
    /// better than any other edge.
    pub min_exclusive_share: f64,
}

impl Default for EdgeSupportConfig {
    fn default() -> Self {
        Self {
            max_end_distance_in_pixels: 4.0,
            max_relative_end_distance: 0.15,
            required_share_of_views: 0.2,
            min_required_views: 2,
            max_required_views: 5,
            min_exclusive_share: 0.5,
        }
    }
}

impl EdgeSupportConfig {
    /// The number of supporting views that an edge needs in a scene of `views`
    /// views: `clip(round(0.2 V), 2, 5)` by default.
    pub fn required_views(&self, views: usize) -> usize {
        let share = (self.required_share_of_views * views as f64).round_ties_even();
        // Saturating: a negative or NaN share becomes 0.
        (share as usize)
            .max(self.min_required_views)
            .min(self.max_required_views)
    }

    /// Largest distance between a detection's ends and those of an edge of this
    /// projected length; the limit itself is too far.
    pub fn end_tolerance(&self, projected_length: f64) -> f64 {
        (self.max_relative_end_distance * projected_length).min(self.max_end_distance_in_pixels)
    }

    /// Whether a detection lies on a projected edge, end on end in this order.
    pub fn confirms(&self, edge: &LineSegment2, detection: &LineSegment2) -> bool {
        let tolerance = self.end_tolerance(edge.length());
        let [start, end] = edge.end_distances(detection);
        start < tolerance && end < tolerance
    }
}

/// A pair of junctions with the views that speak for an edge between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SupportedEdge {
    /// The junctions' indices, the smaller first.
    pub junctions: [usize; 2],
    /// Number of views with a detection on the edge.
    pub support: usize,
    /// Number of views in which the surface does not hide the edge, where
    /// that was tested.
    pub visible_views: Option<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn required_views_follow_the_recipe() {
        let config = EdgeSupportConfig::default();
        let required = [0, 1, 10, 12, 13, 20, 25, 100].map(|v| config.required_views(v));
        assert_eq!(required, [2, 2, 2, 2, 3, 4, 5, 5]);
    }
}
