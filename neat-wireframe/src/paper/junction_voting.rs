//! Junctions that enough views vote for (`initial_recon` of the published code;
//! the paper does not mention this step).

use super::neat_lines::NeatLine;
use crate::metrics::DistanceMatrix;
use nalgebra::Vector3;
use neat_core::assignment::AssignmentError;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// When a view votes for a junction, and how many votes it needs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JunctionVotingConfig {
    /// A view votes for a junction when the line end assigned to it is nearer
    /// than this: world units, strict.
    pub max_distance: f64,
    /// Junctions with so many votes or more are kept; a view has one vote per
    /// junction.
    pub min_votes: usize,
}

impl Default for JunctionVotingConfig {
    fn default() -> Self {
        Self {
            max_distance: 0.02,
            min_votes: 2,
        }
    }
}

/// A junction that at least one view voted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JunctionVotes {
    /// Index of the junction.
    pub junction: usize,
    /// In how many views.
    pub votes: usize,
}

/// Counts the votes of all views, in the order in which junctions get their
/// first vote; the caller keeps those with [`JunctionVotingConfig::min_votes`].
///
/// In each view junctions and line ends are assigned one to one with the smallest
/// sum of distances. All lines take part, supported or not.
///
/// # Errors
/// If a junction or a line is not finite.
pub fn vote_for_junctions(
    junctions: &[Vector3<f64>],
    lines_by_view: &[Vec<NeatLine>],
    config: &JunctionVotingConfig,
) -> Result<Vec<JunctionVotes>, AssignmentError> {
    let voted_by_view: Vec<Vec<usize>> = lines_by_view
        .par_iter()
        .map(|lines| votes_of_view(junctions, lines, config.max_distance))
        .collect::<Result<_, _>>()?;
    let mut tally = vec![0; junctions.len()];
    let mut order = Vec::new();
    for junction in voted_by_view.into_iter().flatten() {
        if tally[junction] == 0 {
            order.push(junction);
        }
        tally[junction] += 1;
    }
    Ok(order
        .into_iter()
        .map(|junction| JunctionVotes {
            junction,
            votes: tally[junction],
        })
        .collect())
}

/// The junctions that one view votes for, ascending.
fn votes_of_view(
    junctions: &[Vector3<f64>],
    lines: &[NeatLine],
    max_distance: f64,
) -> Result<Vec<usize>, AssignmentError> {
    let ends: Vec<Vector3<f64>> = lines.iter().flat_map(|line| line.segment.ends()).collect();
    let pairs = DistanceMatrix::between(junctions, &ends, |a, b| (a - b).norm()).assign()?;
    Ok(pairs
        .into_iter()
        .filter(|pair| pair.distance < max_distance)
        .map(|pair| pair.row)
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::LineSegment3;

    fn line(a: f64, b: f64) -> NeatLine {
        NeatLine {
            segment_in_view: 0,
            segment: LineSegment3::new(Vector3::new(a, 0.0, 0.0), Vector3::new(b, 0.0, 0.0)),
            rays: 1,
            support_distance: 0.0,
        }
    }

    fn on_x(positions: &[f64]) -> Vec<Vector3<f64>> {
        positions
            .iter()
            .map(|x| Vector3::new(*x, 0.0, 0.0))
            .collect()
    }

    #[test]
    fn votes_are_counted_once_per_view_in_order_of_the_first() {
        let junctions = on_x(&[0.0, 1.0, 2.0]);
        let lines = [
            vec![line(1.0, 2.001)],
            // Two ends at the same place: the assignment is one to one.
            vec![line(0.0, 1.01), line(0.0, 1.011)],
            vec![],
        ];
        let votes = vote_for_junctions(&junctions, &lines, &Default::default()).unwrap();
        let expected = [(1, 2), (2, 1), (0, 1)];
        assert_eq!(
            votes,
            expected.map(|(junction, votes)| JunctionVotes { junction, votes })
        );
    }

    #[test]
    fn far_ends_do_not_vote() {
        let config = JunctionVotingConfig {
            max_distance: 0.5,
            ..Default::default()
        };
        let votes = |junctions: &[f64]| {
            vote_for_junctions(&on_x(junctions), &[vec![line(0.5, 3.0)]], &config).unwrap()
        };
        assert_eq!(votes(&[0.0]), []);
        assert_eq!(votes(&[0.25]).len(), 1);
        assert_eq!(votes(&[]), []);
    }

    #[test]
    fn nan_is_an_error() {
        let lines = [vec![line(0.0, 1.0)]];
        assert!(vote_for_junctions(&on_x(&[f64::NAN]), &lines, &Default::default()).is_err());
    }
}
