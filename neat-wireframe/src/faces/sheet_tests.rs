use super::*;
use crate::test_scenes::camera_looking_at_origin;
use nalgebra::Vector3;
use neat_core::{Camera, Wireframe3d};

/// `count` rows of as many points on a rectangle, which all cameras see.
fn points_between(
    corner: Vector3<f64>,
    sides: [Vector3<f64>; 2],
    count: usize,
) -> Vec<SurfacePoint> {
    let share = |k: usize| (k as f64 + 0.5) / count as f64;
    (0..count * count)
        .map(|k| SurfacePoint {
            position: corner + sides[0] * share(k % count) + sides[1] * share(k / count),
            covariance: None,
            seen_from: cameras()
                .iter()
                .map(|camera| camera.center_in_world)
                .collect(),
        })
        .collect()
}

/// Three in front of a wall in the plane y = 0.
fn cameras() -> Vec<Camera> {
    let center = |x: f64| Vector3::new(x, -2.5, 0.1);
    [-0.5, 0.0, 0.5]
        .map(|x| camera_looking_at_origin(&center(x)))
        .to_vec()
}

fn views() -> Vec<ViewObservation> {
    let view = |camera| ViewObservation {
        camera,
        segments: Vec::new(),
        junctions: Vec::new(),
    };
    cameras().into_iter().map(view).collect()
}

/// A wall from −0.6 to 0.6 whose upper edge is missing, with a window from −0.2 to 0.2.
fn open_wall() -> Wireframe3d {
    let square = |a: f64| [[-a, -a], [a, -a], [a, a], [-a, a]];
    let junctions = (square(0.6).into_iter().chain(square(0.2)))
        .map(|[x, z]| Vector3::new(x, 0.0, z))
        .collect();
    let edges = vec![[0, 1], [1, 2], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4]];
    Wireframe3d { junctions, edges }
}

fn shells_of(wireframe: &Wireframe3d, points: &[SurfacePoint]) -> Vec<Shell> {
    shells_in(wireframe, &views(), points)
}

fn shells_in(
    wireframe: &Wireframe3d,
    views: &[ViewObservation],
    points: &[SurfacePoint],
) -> Vec<Shell> {
    find_shells(&MeasuredGraph::of(wireframe), views, points)
}

#[test]
fn points_close_a_wall_that_lacks_an_edge_around_what_they_see_through() {
    let wall = open_wall();
    let on_wall = points_between(
        Vector3::new(-0.6, 0.0, -0.6),
        [Vector3::x() * 1.2, Vector3::z() * 1.2],
        20,
    );
    let is_window = |p: &SurfacePoint| p.position.x.abs() < 0.2 && p.position.z.abs() < 0.2;
    let (_, on_wall): (Vec<_>, Vec<_>) = on_wall.into_iter().partition(is_window);
    // Far enough behind the window to be seen through it from all three.
    let behind = points_between(
        Vector3::new(-0.1, 0.2, -0.1),
        [Vector3::x() * 0.2, Vector3::z() * 0.2],
        8,
    );
    let points: Vec<SurfacePoint> = on_wall.into_iter().chain(behind).collect();
    let shells = shells_of(&wall, &points);
    let graph = MeasuredGraph::of(&wall);
    let area: f64 = (shells.iter())
        .flat_map(|shell| {
            let geometry = ShellGeometry::new(shell, &graph);
            shell.faces.iter().map(move |face| geometry.area(face))
        })
        .sum();
    let is_valid = |face: &Face| face.is_valid(&graph);
    assert!(shells.iter().flat_map(|shell| &shell.faces).all(is_valid));
    assert!(shells.iter().all(|shell| !shell.closed));
    assert!((area - (1.44 - 0.16)).abs() < 1e-9, "{area} {shells:?}");
    let steps = || {
        shells
            .iter()
            .flat_map(|shell| &shell.faces)
            .flat_map(Face::steps)
    };
    // What no edge bounds is inferred.
    assert!(steps().any(|step| step.curve == CurveIndex::Smooth([2, 3])));
    // The window alone is a loop of edges, but points are seen through it.
    assert_eq!(shells_of(&wall, &[]).len(), 1);
    // Nobody knows what is hidden where there are no views.
    assert_eq!(shells_in(&wall, &[], &points), shells_in(&wall, &[], &[]));
}

#[test]
fn what_other_faces_hide_from_all_cameras_is_no_face() {
    let mut wireframe = open_wall();
    let behind = wireframe.junctions.len();
    // A square behind the wall, all of whose edges are there.
    let square = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]];
    (wireframe.junctions).extend(square.map(|[x, z]| Vector3::new(x, 0.4, z)));
    (wireframe.edges).extend((0..4).map(|k| [behind + k, behind + (k + 1) % 4]));
    wireframe
        .edges
        .retain(|edge| edge[0] < 4 || edge[0] >= behind);
    let on_wall = points_between(
        Vector3::new(-0.6, 0.0, -0.6),
        [Vector3::x() * 1.2, Vector3::z() * 1.2],
        20,
    );
    assert_eq!(shells_of(&wireframe, &[])[0].faces[0].steps().count(), 4);
    let shells = shells_of(&wireframe, &on_wall);
    let faces: Vec<&Face> = shells.iter().flat_map(|shell| &shell.faces).collect();
    let is_wall = |face: &&Face| {
        face.steps().all(|step| match step.curve {
            CurveIndex::Edge(edge) => edge < 3,
            _ => true,
        })
    };
    assert!(!faces.is_empty() && faces.iter().all(is_wall), "{faces:?}");
}
