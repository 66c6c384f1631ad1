//! Edges that no image shows: inferred where faces meet, and added to the wireframe.

use super::tests::{Model, UNIT, WHOLE, assert_solid};
use super::*;
use crate::Wireframe3d;
use std::f64::consts::PI;

const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// A cube. The edge from the first junction to the second is left, of all given ones, as a piece of
/// this length from the second on, judged by the edge; of none if that is 0.
fn cut_cube(cut: &[[usize; 2]], length: f64) -> Model {
    let mut cube = Model::default().prism(&SQUARE, [0.0, 1.0]);
    for [from, to] in cut {
        let edges = &mut cube.wireframe.edges;
        edges.retain(|edge| ![[*from, *to], [*to, *from]].contains(edge));
        if length > 0.0 {
            let [a, b] = [from, to].map(|end| cube.wireframe.junctions[*end]);
            edges.push([*to, cube.wireframe.junctions.len()]);
            cube.wireframe.junctions.push(b + length * (a - b));
        }
    }
    cube
}

/// All that begins at the lowest corner.
const AT_CORNER: [[usize; 2]; 3] = [[0, 1], [0, 3], [0, 4]];

/// Two lugs on a block, each with a round end: four coaxial arcs.
fn yoke() -> Model {
    let side = [
        [0.0, 0.0],
        [1.0, 0.0],
        [1.0, 0.6],
        [0.8, 0.6],
        [0.8, 0.2],
        [0.2, 0.2],
        [0.2, 0.6],
        [0.0, 0.6],
    ];
    let mut yoke = Model::default().prism(&side, [0.0, 0.4]);
    let junctions = yoke.wireframe.junctions.clone();
    let is_top = |end: &usize| junctions[*end].y > 0.5;
    yoke.wireframe.edges.retain(|edge| !edge.iter().all(is_top));
    for x in [0.0, 0.2, 0.8, 1.0] {
        yoke = yoke.circle([0.0; 3], 0.2, [0.0, PI]);
        let arc = yoke.arcs.last_mut().unwrap();
        arc.center = Vector3::new(x, 0.6, 0.2);
        arc.axes = [Vector3::z(), Vector3::y()];
    }
    yoke
}

#[test]
fn edges_that_stop_short_of_a_corner_meet_in_it() {
    for length in [0.2, 0.7] {
        // The third ends at the corner, or a little beyond.
        for beyond in [0.0, 0.008] {
            let mut cube = cut_cube(&AT_CORNER[..2], length);
            cube.wireframe.junctions[0] -= Vector3::z() * beyond;
            let (faces, volume) = cube.turned().solid();
            assert_eq!(faces, 6);
            assert!((volume / UNIT - 1.0).abs() < 1e-3);
        }
    }
    // Nothing but the end of one edge says where the corner is.
    assert_solid(cut_cube(&AT_CORNER[..2], 0.0), 6, 1.0);
    // An end that a full corner lies ahead of leads nowhere.
    let mut beside = Model::default().prism(&SQUARE, [0.0, 1.0]);
    (beside.wireframe.junctions).extend([[0.0, 0.0, 1.3], [0.0, 0.0, 1.5]].map(Vector3::from));
    beside.wireframe.edges.push([8, 9]);
    let curves = Curves::new(&beside.graph());
    assert!(creases::continued_ends(&curves).is_empty());
}

#[test]
fn lugs_of_one_cylinder_are_apart() {
    let lugs = 2.0 * 0.2 * (0.4 * 0.4 + 0.5 * PI * 0.04);
    let turned = yoke().turned();
    let (faces, volume) = turned.solid();
    assert_eq!(faces, 10);
    assert!((volume / UNIT - 0.2 * 0.4 - lugs).abs() < 1e-9);
}

#[test]
fn what_a_solid_has_the_wireframe_gets() {
    for (cut, length, inferred) in [
        (&AT_CORNER[..1], 0.0, 1),
        (&AT_CORNER[..2], 0.0, 2),
        (&AT_CORNER[..2], 0.6, 0),
        // Beyond the corner.
        (&AT_CORNER[..1], 1.1, 0),
    ] {
        let cube = cut_cube(cut, length).turned();
        let graph = cube.graph();
        let whole = completed(&graph, &cube.shells()).unwrap();
        let Wireframe3d { junctions, edges } = &whole.wireframe;
        assert_eq!([junctions.len(), edges.len()], [8, 12], "{cut:?} {length}");
        assert!(edges.is_sorted() && edges.iter().all(|[a, b]| a < b));
        let lengths = whole.wireframe.segments().into_iter().map(|s| s.length());
        assert!(lengths.map(|l| l / 1.7 - 1.0).all(|off| off.abs() < 1e-9));
        assert_eq!(whole.inferred().filter(|is| *is).count(), inferred);
        // Each edge before is a piece of one.
        let mut sources: Vec<usize> = whole.sources.concat();
        sources.sort_unstable();
        assert!(sources.into_iter().eq(0..cube.wireframe.edges.len()));
        // Nothing is left to do.
        let again = MeasuredGraph::of(&whole.wireframe);
        let shells = find_shells(&again, &[], &[]);
        assert!(shells[0].closed && completed(&again, &shells).is_none());
        let creases = creases_of_solids(&whole.wireframe, &shells);
        assert!(creases.into_iter().eq(0..12));
    }
}

#[test]
fn sheets_and_smooth_lines_add_nothing() {
    let mut open = cut_cube(&AT_CORNER[..1], 0.0);
    open.wireframe.edges.retain(|edge| !edge.contains(&6));
    let rounded = yoke();
    for model in [open, rounded] {
        let model = model.turned();
        let shells = model.shells();
        assert!(!shells.is_empty());
        assert_eq!(completed(&model.graph(), &shells), None);
    }
    // The sides of a rounded block that touch the round one, whether lines there are edges or not.
    let mut yoke = yoke();
    let is_up = |a: &Vector3<f64>, b: &Vector3<f64>| (a - b).x.abs() > 0.1 && a.y == 0.6;
    let junctions = &yoke.wireframe.junctions;
    let ends = (0..junctions.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
    let smooth: Vec<[usize; 2]> = ends
        .filter(|[a, b]| is_up(&junctions[*a], &junctions[*b]))
        .filter(|[a, b]| (junctions[*a] - junctions[*b]).norm() < 0.25)
        .collect();
    let before = yoke.wireframe.edges.len();
    yoke.wireframe.edges.extend(&smooth);
    let shells = yoke.shells();
    assert!(shells[0].closed && smooth.len() == 4);
    let creases = creases_of_solids(&yoke.wireframe, &shells);
    assert!(creases.into_iter().eq(0..before));
}

#[test]
fn curves_keep_their_junctions() {
    // A hole in the face beside the edge, and a half circle that ends at junctions without edges.
    let mut cube = cut_cube(&AT_CORNER[..1], 0.0).circle([0.5, 0.5, 0.0], 0.2, WHOLE);
    cube = cube
        .circle([0.5, 0.5, 1.0], 0.2, WHOLE)
        .circle([3.0, 0.0, 0.0], 0.5, [0.0, PI]);
    let ends = [2.5, 3.5].map(|x| Vector3::new(x, 0.0, 0.0));
    cube.wireframe.junctions.extend(ends);
    let whole = completed(&cube.graph(), &cube.shells()).unwrap();
    assert_eq!(whole.wireframe.junctions.len(), 10);
    assert_eq!(whole.wireframe.junctions[8..], ends);
}
