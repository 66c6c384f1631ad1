//! The attraction scheme: junctions attract the ends of 3D lines (paper §4.3;
//! `get_wireframe_from_lines_and_junctions` of the published code).

use nalgebra::Vector3;
use neat_core::LineSegment3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Which attracted lines become edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AttractionConfig {
    /// Drop lines whose two ends go to the same junction. The published code
    /// keeps them as edges without length.
    pub exclude_self_loops: bool,
}

impl Default for AttractionConfig {
    fn default() -> Self {
        Self {
            exclude_self_loops: true,
        }
    }
}

/// The junctions that attract the start and the end of a line: the nearest ones,
/// at any distance, the first among equals.
///
/// `None` if there is no junction, or if an end is as far from its junction as
/// the line is long, or farther.
pub fn attracted_ends(line: &LineSegment3, junctions: &[Vector3<f64>]) -> Option<[usize; 2]> {
    let [(start, to_start), (end, to_end)] = [
        nearest(junctions, &line.start)?,
        nearest(junctions, &line.end)?,
    ];
    (to_start.max(to_end) < line.length()).then_some([start, end])
}

/// The edges that the lines turn into: pairs `[i, j]` with `i ≤ j`, sorted, each
/// once. Duplicate lines of many views collapse here.
///
/// # Example
/// ```
/// use nalgebra::Vector3;
/// use neat_core::LineSegment3;
/// use neat_wireframe::paper::{AttractionConfig, attract};
///
/// let junctions = [Vector3::zeros(), Vector3::x(), Vector3::y()];
/// let line = |a, b| LineSegment3::new(a, b);
/// let lines = [
///     line(Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.9, 0.1, 0.0)),
///     line(Vector3::new(1.1, 0.0, 0.0), Vector3::new(0.0, 0.1, 0.0)),
/// ];
/// let edges = attract(&lines, &junctions, &AttractionConfig::default());
/// assert_eq!(edges, [[0, 1]]);
/// ```
pub fn attract(
    lines: &[LineSegment3],
    junctions: &[Vector3<f64>],
    config: &AttractionConfig,
) -> Vec<[usize; 2]> {
    let edges: BTreeSet<[usize; 2]> = lines
        .iter()
        .filter_map(|line| attracted_ends(line, junctions))
        .filter(|[a, b]| a != b || !config.exclude_self_loops)
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.into_iter().collect()
}

fn nearest(junctions: &[Vector3<f64>], point: &Vector3<f64>) -> Option<(usize, f64)> {
    junctions
        .iter()
        .map(|junction| (junction - point).norm())
        .enumerate()
        .min_by(|(_, a), (_, b)| a.total_cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_x(a: f64, b: f64) -> LineSegment3 {
        LineSegment3::new(Vector3::new(a, 0.0, 0.0), Vector3::new(b, 0.0, 0.0))
    }

    const fn junctions() -> [Vector3<f64>; 3] {
        [
            Vector3::new(0.0, 0.0, 0.0),
            Vector3::new(1.0, 0.0, 0.0),
            Vector3::new(3.0, 0.0, 0.0),
        ]
    }

    #[test]
    fn duplicates_collapse_and_edges_are_sorted() {
        let lines = [
            on_x(2.9, 1.2),
            on_x(0.1, 0.9),
            on_x(1.1, -0.1),
            on_x(1.0, 3.0),
        ];
        let edges = attract(&lines, &junctions(), &AttractionConfig::default());
        assert_eq!(edges, [[0, 1], [1, 2]]);
    }

    #[test]
    fn a_line_must_be_longer_than_its_ends_travel() {
        assert_eq!(attracted_ends(&on_x(0.9, 1.6), &junctions()), Some([1, 1]));
        assert_eq!(attracted_ends(&on_x(1.4, 1.8), &junctions()), None);
        // Equal is not longer.
        assert_eq!(attracted_ends(&on_x(-0.5, -1.0), &junctions()), None);
    }

    #[test]
    fn self_loops_are_edges_only_when_asked_for() {
        let lines = [on_x(0.9, 1.3)];
        let published = AttractionConfig {
            exclude_self_loops: false,
        };
        assert_eq!(attract(&lines, &junctions(), &published), [[1, 1]]);
        assert!(attract(&lines, &junctions(), &Default::default()).is_empty());
    }

    #[test]
    fn nothing_attracts_nothing() {
        let config = AttractionConfig {
            exclude_self_loops: false,
        };
        assert!(attract(&[on_x(0.0, 1.0)], &[], &config).is_empty());
        assert!(attract(&[], &junctions(), &config).is_empty());
        assert_eq!(
            attract(&[on_x(0.0, 1.0)], &junctions()[..1], &config),
            Vec::<[usize; 2]>::new()
        );
        assert_eq!(
            attract(&[on_x(0.0, 0.4)], &junctions()[..1], &config),
            Vec::<[usize; 2]>::new()
        );
        assert_eq!(
            attract(&[on_x(-0.3, 0.3)], &junctions()[..1], &config),
            [[0, 0]]
        );
    }

    #[test]
    fn nan_attracts_nothing() {
        assert_eq!(attracted_ends(&on_x(f64::NAN, 1.0), &junctions()), None);
    }
}
