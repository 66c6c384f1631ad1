//! Edges are cut where corners and free ends lie on them, and where they cross.

use super::corners::{Corners, Meeting, beyond_end, nearest_points};
use super::edge_samples::Images;
use neat_core::Wireframe3d;
use std::collections::{BTreeMap, BTreeSet};

/// A junction lies on an edge within so many reaches: less than where ends meet, since a cut
/// bends the edge. Twice as many cost a house and a façade 0.01 of F1 at 1 cm, half as many are
/// the same.
pub(super) const MAX_GAP: f64 = 0.75;
/// Nearer to an end of the edge nothing is cut, in pixels …
const MARGIN_IN_PIXELS: f64 = 3.0;
/// … or as a share of the edge, if that is less.
const MAX_MARGIN: f64 = 0.3;

/// The graph of lines between corners, whose junctions may be more than the edges need, and for
/// each edge the line that it is a piece of, see [`Corners::sources`].
pub(super) fn cut_edges(
    images: &Images,
    mut corners: Corners,
) -> (Wireframe3d, Vec<Option<usize>>) {
    let count = corners.ends.len();
    let mut degrees = corners.degrees();
    // For each line where it is cut, and by which junction.
    let mut cuts: Vec<Vec<(f64, usize)>> = vec![Vec::new(); count];
    for (meeting, side) in nearest_first(&corners) {
        let [stem, bar] = [meeting.lines[side], meeting.lines[1 - side]];
        let [stem_line, bar_line] = [stem, bar].map(|line| corners.edge(line));
        let (beyond, end) = beyond_end(meeting.places[side], stem_line.length());
        let junction = corners.ends[stem][end];
        let is_end = beyond.abs() <= corners.windows[stem];
        if !is_end
            || corners.ends[bar].contains(&junction)
            || cuts[bar].iter().any(|(_, other)| *other == junction)
        {
            continue;
        }
        let place = if degrees[junction] > 1 {
            bar_line.line_parameter(&corners.junctions[junction])
        } else {
            let Some(([_, place], _)) = nearest_points(&stem_line, &bar_line) else {
                continue;
            };
            place
        };
        let pixel = corners.pixels[stem].max(corners.pixels[bar]);
        let margin = (MARGIN_IN_PIXELS * pixel / bar_line.length()).min(MAX_MARGIN);
        let foot = bar_line.point_at(place);
        let from = if degrees[junction] > 1 {
            corners.junctions[junction]
        } else {
            stem_line.point_at(stem_line.line_parameter(&foot))
        };
        let near = (from - foot).norm() <= MAX_GAP * images.reach * pixel;
        if !(near && margin < place && place < 1.0 - margin) {
            continue;
        }
        if degrees[junction] == 1 {
            // The end of the stem comes to the bar, which stays straight.
            corners.junctions[junction] = foot;
            degrees[junction] += 2;
        }
        cuts[bar].push((place, junction));
    }
    cut_crossings(images, &mut corners, &mut cuts);
    let mut edges = BTreeMap::new();
    for ((ends, source), cuts) in corners.ends.iter().zip(&corners.sources).zip(&mut cuts) {
        cuts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let inner = cuts.iter().map(|(_, junction)| *junction);
        let along: Vec<usize> = std::iter::once(ends[0])
            .chain(inner)
            .chain([ends[1]])
            .collect();
        for pair in along.windows(2) {
            let [a, b] = [pair[0].min(pair[1]), pair[0].max(pair[1])];
            let apart = corners.junctions[a] != corners.junctions[b];
            if a != b && apart {
                edges.entry([a, b]).or_insert(*source);
            }
        }
    }
    let (edges, sources) = edges.into_iter().unzip();
    let junctions = corners.junctions;
    (Wireframe3d { junctions, edges }, sources)
}

/// Both sides of all meetings, those that lie nearest to the end of their line first: of two edges
/// that an end could come to, the nearer one is its own.
fn nearest_first(corners: &Corners) -> Vec<(Meeting, usize)> {
    let mut sides: Vec<(f64, Meeting, usize)> = (corners.meetings.iter())
        .flat_map(|meeting| [0, 1].map(|side| (meeting, side)))
        .map(|(meeting, side)| {
            let line = meeting.lines[side];
            let (beyond, _) = beyond_end(meeting.places[side], corners.edge(line).length());
            (beyond.abs() / corners.pixels[line], *meeting, side)
        })
        .collect();
    sides.sort_by(|(a, ..), (b, ..)| a.total_cmp(b));
    let in_order = sides.into_iter().map(|(_, meeting, side)| (meeting, side));
    in_order.collect()
}

/// Cuts edges where they cross each other: there is a junction, though none of them ends.
fn cut_crossings(images: &Images, corners: &mut Corners, cuts: &mut [Vec<(f64, usize)>]) {
    for meeting in &corners.meetings {
        let lines = meeting.lines.map(|line| corners.edge(line));
        let pixel = (meeting.lines.iter().map(|k| corners.pixels[*k])).fold(0.0, f64::max);
        let Some((places, gap)) = nearest_points(&lines[0], &lines[1]) else {
            continue;
        };
        let is_apart = |side: usize| {
            let (line, place) = (meeting.lines[side], places[side]);
            let margin = MARGIN_IN_PIXELS * pixel / lines[side].length();
            (cuts[line].iter().map(|(cut, _)| *cut).chain([0.0, 1.0]))
                .all(|other| (place - other).abs() > margin)
                && (0.0..1.0).contains(&place)
        };
        if gap <= MAX_GAP * images.reach * pixel && is_apart(0) && is_apart(1) {
            let junction = corners.junctions.len();
            let middle = 0.5 * (lines[0].point_at(places[0]) + lines[1].point_at(places[1]));
            corners.junctions.push(middle);
            for (line, place) in meeting.lines.into_iter().zip(places) {
                cuts[line].push((place, junction));
            }
        }
    }
}

/// Takes the edges away that are not `kept`, with the lines that they are pieces of.
pub(super) fn retain_edges(
    kept: &[bool],
    edges: &mut Vec<[usize; 2]>,
    sources: &mut Vec<Option<usize>>,
) {
    let mut of_edges = kept.iter();
    edges.retain(|_| of_edges.next() == Some(&true));
    let mut of_edges = kept.iter();
    sources.retain(|_| of_edges.next() == Some(&true));
}

/// The junctions that edges use, and some others, in lexicographic order of their coordinates, and
/// the edges, sorted.
pub(super) fn in_order(wireframe: &Wireframe3d, others: BTreeSet<usize>) -> Wireframe3d {
    let Wireframe3d { junctions, edges } = wireframe;
    let mut used = others;
    used.extend(edges.iter().flatten());
    let mut order: Vec<usize> = used.into_iter().collect();
    let at = |junction: &usize| -> [f64; 3] { junctions[*junction].into() };
    order.sort_by(|a, b| {
        let pairs = at(a).into_iter().zip(at(b));
        let first = pairs.map(|(x, y)| x.total_cmp(&y)).find(|o| o.is_ne());
        first.unwrap_or(std::cmp::Ordering::Equal)
    });
    let mut new_index = vec![0; junctions.len()];
    for (new, old) in order.iter().enumerate() {
        new_index[*old] = new;
    }
    let mut edges: Vec<[usize; 2]> = (edges.iter())
        .map(|edge| {
            let [a, b] = edge.map(|junction| new_index[junction]);
            [a.min(b), a.max(b)]
        })
        .collect();
    edges.sort_unstable();
    Wireframe3d {
        junctions: order.iter().map(|old| junctions[*old]).collect(),
        edges,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::corners::find_corners;
    use crate::assemble::line_evidence::{LineEvidence, Showing};
    use crate::assemble::line_selection::ChosenLine;
    use crate::assemble::test_views::TestViews;
    use neat_core::LineSegment3;

    fn graph_of(lines: &[[[f64; 3]; 2]]) -> Wireframe3d {
        let cube = TestViews::of_cube(4);
        let images = cube.images();
        let chosen = |[a, b]: &[[f64; 3]; 2]| ChosenLine {
            line: LineSegment3::new((*a).into(), (*b).into()),
            placed: false,
            evidence: LineEvidence {
                gain: 9.0,
                showing: vec![Showing {
                    view: 0,
                    chance: 0.1,
                }],
                ..LineEvidence::default()
            },
        };
        let lines: Vec<ChosenLine> = lines.iter().map(chosen).collect();
        in_order(
            &cut_edges(&images, find_corners(&images, &lines, (&[], &[]))).0,
            BTreeSet::new(),
        )
    }

    #[test]
    fn of_two_edges_a_free_end_comes_to_the_nearer_one() {
        let bar = |y: f64| [[-0.4, y, 0.0], [0.6, y, 0.0]];
        let stem = [[0.1, -0.5, 0.0], [0.1, -0.04, 0.0]];
        for bars in [[0.0, -0.03], [-0.03, 0.0]] {
            let graph = graph_of(&[bar(bars[0]), bar(bars[1]), stem]);
            assert_eq!([graph.junctions.len(), graph.edges.len()], [6, 4]);
            let corner = nalgebra::Vector3::new(0.1, -0.03, 0.0);
            assert!(graph.junctions.iter().any(|j| (j - corner).norm() < 1e-9));
        }
    }

    #[test]
    fn lines_that_cross_have_a_junction_there_and_those_that_pass_have_none() {
        let graph = |height: f64| {
            graph_of(&[
                [[-0.4, 0.0, 0.0], [0.6, 0.0, 0.0]],
                [[0.1, -0.5, height], [0.1, 0.3, height]],
            ])
        };
        let crossing = graph(0.0);
        assert_eq!([crossing.junctions.len(), crossing.edges.len()], [5, 4]);
        let apart = (crossing.junctions.iter())
            .map(|junction| (junction - nalgebra::Vector3::new(0.1, 0.0, 0.0)).norm())
            .fold(f64::INFINITY, f64::min);
        assert!(apart < 1e-9);
        let passing = graph(0.1);
        assert_eq!([passing.junctions.len(), passing.edges.len()], [4, 2]);
    }
}
