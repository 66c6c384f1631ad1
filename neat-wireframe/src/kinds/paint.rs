//! A wireframe without what is painted on things, or falls on them as light.

use super::EdgeKinds;
use crate::used_junctions::UsedJunctions;
use nalgebra::Vector3;
use neat_core::{CircularArc, Spline, Wireframe3d};

/// Cosine of the largest angle at which two pieces go on in each other, about 2°: pieces of one
/// edge are fitted each on its own.
const STRAIGHT: f64 = 0.9994;
/// An arc ends at a junction that is no farther from its end, in radii.
const AT_END: f64 = 1e-6;

/// What is left of a wireframe.
#[derive(Clone, Debug, PartialEq)]
pub struct WithoutPaint {
    /// Edges `[a, b]`, a < b, sorted, as the assembler has them.
    pub wireframe: Wireframe3d,
    /// Those of its edges.
    pub kinds: Vec<EdgeKinds>,
    /// How many edges went.
    pub painted: usize,
}

/// The wireframe without the edges that are structure with less than this probability, and the
/// kinds of the others. Edges that were cut only where one of these met them are whole again, and
/// junctions that had no other edge are gone, unless an arc or a spline ends there.
///
/// # Panics
/// If the kinds are of another wireframe.
pub fn without_paint(
    wireframe: &Wireframe3d,
    (arcs, splines): (&[CircularArc], &[Spline]),
    kinds: &[EdgeKinds],
    min_structure: f64,
) -> WithoutPaint {
    assert_eq!(
        wireframe.edges.len(),
        kinds.len(),
        "kinds of another wireframe"
    );
    let is_structure = |kinds: &EdgeKinds| kinds.structure() >= min_structure;
    let mut graph = Graph::new(wireframe, kinds);
    let (mut touched, mut painted) = (vec![false; wireframe.junctions.len()], 0);
    for (index, kinds) in kinds.iter().enumerate() {
        if !is_structure(kinds) {
            painted += 1;
            let ends = graph.remove(index);
            ends.iter().for_each(|end| touched[*end] = true);
        }
    }
    let ends_curve = |point: &Vector3<f64>| {
        let is_end = |arc: &CircularArc| {
            let apart = arc.angles.map(|angle| (arc.point_at(angle) - point).norm());
            apart.into_iter().any(|apart| apart <= AT_END * arc.radius)
        };
        let ends_spline = |spline: &Spline| {
            let ends = [spline.controls.first(), spline.controls.last()];
            !spline.closed && ends.contains(&Some(point))
        };
        arcs.iter().any(is_end) || splines.iter().any(ends_spline)
    };
    let is_cut =
        |junction: &usize| touched[*junction] && !ends_curve(&wireframe.junctions[*junction]);
    let (cut, others): (Vec<usize>, Vec<usize>) = (0..touched.len()).partition(is_cut);
    for junction in cut {
        graph.heal(junction);
    }
    let (wireframe, kinds) = graph.finished(&others);
    WithoutPaint {
        wireframe,
        kinds,
        painted,
    }
}

/// Edges that go, and pieces that become one.
struct Graph<'a> {
    junctions: &'a [Vector3<f64>],
    edges: Vec<Option<([usize; 2], EdgeKinds)>>,
    /// The edges at each junction.
    at: Vec<Vec<usize>>,
}

impl<'a> Graph<'a> {
    fn new(wireframe: &'a Wireframe3d, kinds: &[EdgeKinds]) -> Self {
        let mut at = vec![Vec::new(); wireframe.junctions.len()];
        for (index, ends) in wireframe.edges.iter().enumerate() {
            ends.iter().for_each(|end| at[*end].push(index));
        }
        let edges = wireframe.edges.iter().zip(kinds);
        Self {
            junctions: &wireframe.junctions,
            edges: edges.map(|(ends, kinds)| Some((*ends, *kinds))).collect(),
            at,
        }
    }

    /// The ends of the edge that goes.
    fn remove(&mut self, edge: usize) -> Vec<usize> {
        let ends = self.edges[edge].take().map(|(ends, _)| ends);
        for end in ends.iter().flatten() {
            self.at[*end].retain(|other| *other != edge);
        }
        ends.into_iter().flatten().collect()
    }

    /// Makes one edge of two that go on in each other at a junction, if no third one is there.
    fn heal(&mut self, junction: usize) -> Option<()> {
        let [first, second] = *self.at[junction].as_slice() else {
            return None;
        };
        let ((one, of_one), (two, of_two)) = (self.edges[first]?, self.edges[second]?);
        let far = |ends: [usize; 2]| ends.into_iter().find(|end| *end != junction);
        let (start, end) = (far(one)?, far(two)?);
        let [before, after] = [
            self.junctions[junction] - self.junctions[start],
            self.junctions[end] - self.junctions[junction],
        ];
        let lengths = [before.norm(), after.norm()];
        let is_known =
            |edge: &usize| self.edges[*edge].is_some_and(|(ends, _)| ends.contains(&end));
        if start == end
            || self.at[start].iter().any(is_known)
            || before.dot(&after) < STRAIGHT * lengths[0] * lengths[1]
        {
            return None;
        }
        self.remove(second);
        self.at[junction].clear();
        self.at[end].push(first);
        let share = lengths[0] / (lengths[0] + lengths[1]);
        self.edges[first] = Some(([start, end], of_one.mixed(&of_two, share)));
        Some(())
    }

    /// With the junctions that edges join, and `others`.
    fn finished(self, others: &[usize]) -> (Wireframe3d, Vec<EdgeKinds>) {
        let edges = self.edges.into_iter().flatten();
        let mut left: Vec<([usize; 2], EdgeKinds)> = (edges)
            .map(|([a, b], kinds)| ([a.min(b), a.max(b)], kinds))
            .collect();
        left.sort_by_key(|(ends, _)| *ends);
        let (edges, kinds): (Vec<[usize; 2]>, Vec<EdgeKinds>) = left.into_iter().unzip();
        let staying: Vec<[usize; 2]> = others.iter().map(|junction| [*junction; 2]).collect();
        let used = UsedJunctions::new(self.junctions.len(), edges.iter().chain(&staying));
        let mut junctions = self.junctions.to_vec();
        used.retain(&mut junctions);
        let edges = edges.into_iter().map(|edge| used.renamed(edge)).collect();
        (Wireframe3d { junctions, edges }, kinds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(structure: f64) -> EdgeKinds {
        EdgeKinds {
            crease: structure,
            boundary: 0.0,
            texture: 1.0 - structure,
            shadow: 0.0,
        }
    }

    /// A line along x in two pieces, which a painted one meets in the middle, and a wall behind it.
    fn crossed() -> (Wireframe3d, Vec<EdgeKinds>) {
        let place = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let junctions = vec![
            place(0.0, 0.0),
            place(1.0, 0.0),
            place(3.0, 0.0),
            place(1.0, 1.0),
        ];
        let wireframe = Wireframe3d {
            junctions,
            edges: vec![[0, 1], [1, 2], [1, 3]],
        };
        (wireframe, vec![kinds(0.9), kinds(0.6), kinds(0.2)])
    }

    fn left(wireframe: &Wireframe3d, arcs: &[CircularArc], kinds: &[EdgeKinds]) -> Wireframe3d {
        without_paint(wireframe, (arcs, &[]), kinds, 0.5).wireframe
    }

    #[test]
    fn edges_that_paint_has_cut_are_whole_again() {
        let (wireframe, kinds) = crossed();
        let left = without_paint(&wireframe, (&[], &[]), &kinds, 0.5);
        assert_eq!(left.wireframe.edges, [[0, 1]]);
        let ends = [wireframe.junctions[0], wireframe.junctions[2]];
        assert_eq!(left.wireframe.junctions, ends);
        assert!((left.kinds[0].structure() - 0.7).abs() < 1e-12);
        assert_eq!(left.painted, 1);
    }

    #[test]
    fn no_edge_is_there_twice() {
        let (mut wireframe, mut kinds) = crossed();
        wireframe.edges.insert(1, [0, 2]);
        kinds.insert(1, kinds[0]);
        let left = left(&wireframe, &[], &kinds);
        assert_eq!(left.edges, [[0, 1], [0, 2], [1, 2]]);
    }

    #[test]
    fn an_arc_keeps_the_junction_at_which_it_ends() {
        let (wireframe, kinds) = crossed();
        let through = [3, 0, 1].map(|junction| wireframe.junctions[junction]);
        let arc = CircularArc::through(through).unwrap();
        let left = left(&wireframe, &[arc], &kinds);
        assert_eq!(left.edges, [[0, 1], [1, 2]]);
        assert_eq!(left.junctions, wireframe.junctions);
    }

    #[test]
    fn what_is_not_asked_for_stays() {
        let (mut wireframe, kinds) = crossed();
        wireframe.junctions.push(Vector3::new(9.0, 0.0, 0.0));
        let all = without_paint(&wireframe, (&[], &[]), &kinds, 0.0);
        assert_eq!((&all.wireframe, &all.kinds), (&wireframe, &kinds));
        let nothing = without_paint(&wireframe, (&[], &[]), &kinds, 1.0).wireframe;
        assert_eq!(nothing.junctions, [wireframe.junctions[4]]);
        assert!(nothing.edges.is_empty());
    }

    #[test]
    fn a_corner_stays_one() {
        let (mut wireframe, kinds) = crossed();
        wireframe.junctions[2] = Vector3::new(1.0, -2.0, 0.0);
        let left = left(&wireframe, &[], &kinds);
        assert_eq!(left.edges, [[0, 1], [1, 2]]);
        assert_eq!(left.junctions, wireframe.junctions[..3]);
    }
}
