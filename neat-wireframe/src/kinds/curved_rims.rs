//! Which edges are pieces of a curve.
//!
//! Detectors break the rim of a hole or of a tower into short segments, and a
//! wireframe holds them as a chain of edges. They are no edges of the object's
//! graph, and results ought to say so.

use crate::Wireframe3d;
use nalgebra::Vector3;
use pathfinding::undirected::connected_components::components;

/// Pieces of a curve turn by at least this angle …
const MIN_TURN_IN_DEGREES: f64 = 5.0;
/// … and at most this one: more is a corner.
const MAX_TURN_IN_DEGREES: f64 = 40.0;
/// The shorter of two neighbouring pieces is at least this share of the longer.
const MIN_LENGTH_RATIO: f64 = 0.4;
/// Cosine of the angle between successive axes of turning, at least: a curve stays
/// in its plane and turns to one side.
const MIN_AXIS_COSINE: f64 = 0.8;
/// Turns of a curve of four pieces.
const MIN_TURNS: usize = 3;

/// For every edge whether it is a piece of a curve: one of at least four edges,
/// joined end to end and of similar lengths, that turn to the same side in one
/// plane by 5 to 40 degrees each.
///
/// Edges that name no junction, and junctions that are not finite, belong to no
/// curve.
///
/// ```
/// use nalgebra::Vector3;
/// use neat_wireframe::Wireframe3d;
/// use neat_wireframe::kinds::curved_chains;
///
/// let angle = |i: usize| std::f64::consts::TAU * i as f64 / 16.0;
/// let circle = Wireframe3d {
///     junctions: (0..16).map(|i| Vector3::new(angle(i).cos(), angle(i).sin(), 0.0)).collect(),
///     edges: (0..16).map(|i| [i, (i + 1) % 16]).collect(),
/// };
/// assert!(curved_chains(&circle).iter().all(|curved| *curved));
/// ```
pub fn curved_chains(wireframe: &Wireframe3d) -> Vec<bool> {
    let turns = turns(wireframe);
    // The turns at the two ends of each edge, with the side of the edge.
    let mut turns_of: Vec<Vec<(usize, usize)>> = vec![Vec::new(); wireframe.edges.len()];
    for (index, turn) in turns.iter().enumerate() {
        for (place, edge) in turn.edges.iter().enumerate() {
            turns_of[*edge].push((index, place));
        }
    }
    let mut same_curve: Vec<Vec<usize>> = Vec::new();
    for of_edge in &turns_of {
        let [(first, i), (second, j)] = of_edge[..] else {
            continue;
        };
        // Walking on along the edge, one turn has it as its second edge and the
        // other as its first; a turn walked backwards has the opposite axis.
        let sign = if i == j { -1.0 } else { 1.0 };
        if sign * turns[first].axis.dot(&turns[second].axis) >= MIN_AXIS_COSINE {
            same_curve.push(vec![first, second]);
        }
    }
    let mut curved = vec![false; wireframe.edges.len()];
    for curve in components(&same_curve) {
        if curve.len() >= MIN_TURNS {
            for edge in curve.into_iter().flat_map(|turn| turns[turn].edges) {
                curved[edge] = true;
            }
        }
    }
    curved
}

/// Two edges that meet under the angle of a curve.
struct Turn {
    edges: [usize; 2],
    /// Unit vector around which the direction turns from the first to the second.
    axis: Vector3<f64>,
}

/// An edge as it leaves a junction.
struct Leaving {
    edge: usize,
    direction: Vector3<f64>,
    length: f64,
}

/// At every junction the pairs of edges that continue each other best, if they do
/// as pieces of a curve.
fn turns(wireframe: &Wireframe3d) -> Vec<Turn> {
    let mut leaving: Vec<Vec<Leaving>> = wireframe.junctions.iter().map(|_| Vec::new()).collect();
    for (edge, [a, b]) in wireframe.edges.iter().enumerate() {
        for (from, to) in [(*a, *b), (*b, *a)] {
            let ends = Option::zip(wireframe.junctions.get(from), wireframe.junctions.get(to));
            let Some(offset) = ends.map(|(from, to)| to - from) else {
                continue;
            };
            let length = offset.norm();
            if length.is_normal() {
                leaving[from].push(Leaving {
                    edge,
                    direction: offset / length,
                    length,
                });
            }
        }
    }
    let mut turns = Vec::new();
    for edges in &leaving {
        let best: Vec<Option<usize>> = (0..edges.len()).map(|i| straightest(edges, i)).collect();
        for (i, j) in best.iter().enumerate() {
            if let Some(j) = *j
                && i < j
                && best[j] == Some(i)
                && let Some(turn) = turn(&edges[i], &edges[j])
            {
                turns.push(turn);
            }
        }
    }
    turns
}

/// The edge that goes on most nearly straight from the i-th one.
fn straightest(edges: &[Leaving], i: usize) -> Option<usize> {
    let cosine = |j: usize| -edges[i].direction.dot(&edges[j].direction);
    (0..edges.len())
        .filter(|j| *j != i)
        .max_by(|a, b| cosine(*a).total_cmp(&cosine(*b)).then(b.cmp(a)))
}

fn turn(first: &Leaving, second: &Leaving) -> Option<Turn> {
    let arriving = -first.direction;
    let degrees = arriving.angle(&second.direction).to_degrees();
    let ratio = first.length.min(second.length) / first.length.max(second.length);
    let axis = arriving.cross(&second.direction).try_normalize(1e-12)?;
    let of_curve =
        (MIN_TURN_IN_DEGREES..=MAX_TURN_IN_DEGREES).contains(&degrees) && ratio >= MIN_LENGTH_RATIO;
    of_curve.then_some(Turn {
        edges: [first.edge, second.edge],
        axis,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::cube;

    /// A regular polygon of `sides`, or the part of it with that many pieces.
    fn arc(sides: usize, pieces: usize) -> Wireframe3d {
        let point = |i: usize| {
            let angle = std::f64::consts::TAU * i as f64 / sides as f64;
            Vector3::new(angle.cos(), angle.sin(), 0.3)
        };
        let closed = pieces == sides;
        Wireframe3d {
            junctions: (0..pieces + usize::from(!closed)).map(point).collect(),
            edges: (0..pieces)
                .map(|i| [i, if closed { (i + 1) % sides } else { i + 1 }])
                .collect(),
        }
    }

    #[test]
    fn rims_are_curves_and_corners_are_not() {
        for (sides, pieces, curved) in [
            (16, 16, true),
            (12, 12, true),
            (20, 4, true),
            (20, 3, false),
            (8, 8, false),
            (100, 100, false),
        ] {
            let found = curved_chains(&arc(sides, pieces));
            assert_eq!(found, vec![curved; pieces], "{pieces} of {sides}");
        }
        let (junctions, edges) = cube();
        let cube = Wireframe3d { junctions, edges };
        assert_eq!(curved_chains(&cube), [false; 12]);
    }

    #[test]
    fn the_order_of_an_edges_ends_does_not_matter() {
        let mut rim = arc(16, 16);
        for (i, edge) in rim.edges.iter_mut().enumerate() {
            if i % 3 == 0 {
                edge.reverse();
            }
        }
        assert_eq!(curved_chains(&rim), [true; 16]);
    }

    #[test]
    fn zigzags_and_uneven_chains_are_no_curves() {
        let zigzag = Wireframe3d {
            junctions: (0..9)
                .map(|i| Vector3::new(f64::from(i), 0.2 * f64::from(i % 2), 0.0))
                .collect(),
            edges: (0..8).map(|i| [i, i + 1]).collect(),
        };
        assert_eq!(curved_chains(&zigzag), [false; 8]);
        let mut uneven = arc(16, 6);
        // Every other piece shrinks to a fifth.
        for i in 0..3 {
            let offset = 0.8 * (uneven.junctions[2 * i + 1] - uneven.junctions[2 * i]);
            for junction in &mut uneven.junctions[2 * i + 1..] {
                *junction -= offset;
            }
        }
        assert_eq!(curved_chains(&uneven), [false; 6]);
    }

    #[test]
    fn an_edge_that_ends_on_a_rim_is_no_part_of_it() {
        let mut rim = arc(16, 16);
        rim.junctions.push(Vector3::new(3.0, 0.0, 0.3));
        rim.edges.push([0, 16]);
        let curved = curved_chains(&rim);
        assert_eq!(curved[..16], [true; 16]);
        assert!(!curved[16]);
    }

    #[test]
    fn anything_may_be_asked() {
        let broken = Wireframe3d {
            junctions: vec![
                Vector3::zeros(),
                Vector3::repeat(f64::NAN),
                Vector3::zeros(),
            ],
            edges: vec![[0, 1], [0, 7], [0, 2], [1, 1]],
        };
        assert_eq!(curved_chains(&broken), [false; 4]);
        assert!(curved_chains(&Wireframe3d::default()).is_empty());
    }
}
