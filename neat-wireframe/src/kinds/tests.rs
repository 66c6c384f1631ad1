//! Rendered edges whose kinds are known.

use super::edge_frame::{HALF_PLANES, Side};
use super::*;
use crate::test_scenes::camera_looking_at_origin;
use nalgebra::Vector2;
use neat_core::synthetic::{Solid, render};
use neat_core::{LineSegment3, Ray, Similarity, View, Wireframe2d};
use std::f64::consts::TAU;

/// As in the default configuration.
const MIN_STRUCTURE: f64 = 0.33;

/// Twelve cameras at 15° and 30° from the z axis.
fn cameras() -> Vec<Camera> {
    let center = |i: usize| {
        let tilt = [15_f64, 30.0][i % 2].to_radians();
        let (sin, cos) = (TAU * i as f64 / 12.0).sin_cos();
        2.5 * Vector3::new(tilt.sin() * cos, tilt.sin() * sin, tilt.cos())
    };
    (0..12)
        .map(|i| camera_looking_at_origin(&center(i)))
        .collect()
}

/// Smooth noise from 0 to 1 on a surface; its grains are five pixels wide.
fn grain(x: f64, y: f64) -> f64 {
    let (x, y) = (x / 0.02 + 1e4, y / 0.02 + 1e4);
    let at = |i: f64, j: f64| {
        let seed = (x.floor() + i) * 12.9898 + (y.floor() + j) * 78.233;
        (seed.sin() * 43_758.547).rem_euclid(1.0)
    };
    let row = |j: f64| at(0.0, j) * (1.0 - x.fract()) + at(1.0, j) * x.fract();
    row(0.0) * (1.0 - y.fract()) + row(1.0) * y.fract()
}

/// The surface z = −slope·|y|, seen by all cameras; `brightness` is that of a point.
fn scene_of(slope: f64, brightness: impl Fn(f64, f64) -> f64) -> Scene {
    let height = |ray: &Ray, side: f64| {
        // On this side z = −slope·side·y.
        let normal = Vector3::new(0.0, slope * side, 1.0);
        let point =
            ray.origin - ray.direction * normal.dot(&ray.origin) / normal.dot(&ray.direction);
        (point.y * side >= 0.0).then_some(point)
    };
    let view = |(index, camera): (usize, &Camera)| {
        let mut image = render(&Solid::Box.frustum(), camera, false);
        for (column, row, pixel) in image.enumerate_pixels_mut() {
            let at = Vector2::new(f64::from(column) + 0.5, f64::from(row) + 0.5);
            let ray = camera.ray_through(&at);
            let distance = |point: &Vector3<f64>| (point - ray.origin).norm();
            let hits = [1.0, -1.0].map(|side| height(&ray, side));
            let nearest =
                (hits.into_iter().flatten()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
            let value = nearest.map_or(0.0, |p| brightness(p.x, p.y));
            pixel.0 = [value.clamp(0.0, 255.0) as u8; 3];
        }
        View {
            name: format!("{index:04}"),
            camera: *camera,
            wireframe: Wireframe2d::empty(camera.width, camera.height),
            image: image.into(),
        }
    };
    Scene {
        name: "edge".into(),
        views: cameras().iter().enumerate().map(view).collect(),
        original_from_world: Similarity::identity(),
        pixel_center: 0.5,
        sphere_radius: 1.0,
        sparse_points: Vec::new(),
    }
}

/// An edge that the first views show, of twelve that ought to.
fn shown_in(views: usize) -> EdgeConfidence {
    EdgeConfidence {
        showing_views: (0..views).collect(),
        expected_views: 12,
        ..EdgeConfidence::default()
    }
}

/// The kinds of an edge along x through the origin.
fn kinds_of(scene: &Scene) -> EdgeKinds {
    let wireframe = Wireframe3d {
        junctions: vec![Vector3::new(-0.4, 0.0, 0.0), Vector3::new(0.4, 0.0, 0.0)],
        edges: vec![[0, 1]],
    };
    edge_kinds(&wireframe, scene, &[shown_in(12)], MIN_STRUCTURE).unwrap()[0]
}

/// A step of brightness along the edge, and grain on both sides.
fn step(x: f64, y: f64) -> f64 {
    let side = if y > 0.0 { 200.0 } else { 120.0 };
    side * (0.7 + 0.3 * grain(x, y))
}

#[test]
fn a_step_is_a_crease_of_two_faces_and_perhaps_a_shadow_on_one() {
    let roof = kinds_of(&scene_of(0.8, step));
    assert_eq!(roof.most_likely().0, EdgeKind::Crease, "{roof:?}");
    // More than without any witness.
    assert!(roof.structure() > 0.65, "{roof:?}");
    let floor = kinds_of(&scene_of(0.0, step));
    assert!(floor.structure() < 0.6, "{floor:?}");
    assert!(floor.shadow > 2.0 * floor.texture, "{floor:?}");
}

#[test]
fn a_dark_line_within_a_face_is_texture() {
    let joint = |x: f64, y: f64| {
        if y.abs() < 0.01 {
            40.0
        } else {
            160.0 + 60.0 * grain(x, y)
        }
    };
    let kinds = kinds_of(&scene_of(0.0, joint));
    assert_eq!(kinds.most_likely().0, EdgeKind::Texture, "{kinds:?}");
    assert!(kinds.texture > 0.8, "{kinds:?}");
}

#[test]
fn without_texture_a_step_stays_a_crease() {
    let kinds = kinds_of(&scene_of(0.0, |_, y| if y > 0.0 { 200.0 } else { 120.0 }));
    assert_eq!(kinds.most_likely().0, EdgeKind::Crease, "{kinds:?}");
}

#[test]
fn probabilities_add_up_and_anything_may_be_asked() {
    let scene = scene_of(0.0, grain);
    let wireframe = Wireframe3d {
        junctions: vec![
            Vector3::zeros(),
            Vector3::zeros(),
            Vector3::new(9.0, 9.0, 9e9),
        ],
        edges: vec![[0, 1], [1, 2], [2, 2]],
    };
    for (views, most_likely) in [(12, EdgeKind::Crease), (0, EdgeKind::Texture)] {
        let edges = vec![shown_in(views); 3];
        for kinds in edge_kinds(&wireframe, &scene, &edges, MIN_STRUCTURE).unwrap() {
            let rest = kinds.texture + kinds.shadow;
            assert!((kinds.structure() + rest - 1.0).abs() < 1e-12, "{kinds:?}");
            assert_eq!(kinds.most_likely().0, most_likely);
        }
    }
    assert!(
        edge_kinds(&Wireframe3d::default(), &scene, &[], MIN_STRUCTURE)
            .unwrap()
            .is_empty()
    );
}

#[test]
fn what_few_of_many_views_show_is_hardly_structure_unless_edges_meet_it() {
    let scene = scene_of(0.8, step);
    let [start, end] = [-0.4, 0.4].map(|x| Vector3::new(x, 0.0, 0.0));
    let beyond = [start, end].map(|point| 1.5 * point);
    // The first of some edges, if so many views show the others.
    let structure = |edges: Vec<[usize; 2]>, expected_views: usize, others_shown: usize| {
        let wireframe = Wireframe3d {
            junctions: vec![start, end, beyond[0], beyond[1]],
            edges,
        };
        let confidence = |shown: usize| EdgeConfidence {
            expected_views,
            ..shown_in(shown)
        };
        let mut confidences = vec![confidence(others_shown); wireframe.edges.len()];
        confidences[0] = confidence(2);
        edge_kinds(&wireframe, &scene, &confidences, MIN_STRUCTURE).unwrap()[0].structure()
    };
    let [alone, met] = [vec![[0, 1]], vec![[0, 1], [0, 2], [1, 3]]];
    assert!(structure(alone.clone(), 40, 2) < 0.25, "it is rare");
    assert!(structure(alone, 5, 2) > 0.6, "few views ought to show it");
    for others in [2, 12] {
        assert!(
            structure(met.clone(), 40, others) > 0.6,
            "{others} show what meets it"
        );
    }
    assert!(structure(met, 40, 0) < 0.25, "what is none meets it");
}

#[test]
fn what_no_view_shows_is_as_what_it_joins() {
    let wireframe = Wireframe3d {
        junctions: (0..5).map(|k| Vector3::ith(0, f64::from(k))).collect(),
        edges: vec![[0, 1], [1, 2], [2, 3], [3, 4]],
    };
    let of = |structure: f64| EdgeKinds {
        crease: structure,
        boundary: 0.0,
        texture: 1.0 - structure,
        shadow: 0.0,
    };
    let left = |shown: [usize; 4], structure: [f64; 4]| {
        let mut kinds = structure.map(of);
        take_after_neighbours(&wireframe, &shown.map(shown_in), &mut kinds);
        kinds.map(|kinds| kinds.structure())
    };
    assert_eq!(
        left([6, 0, 6, 6], [0.2, 0.8, 0.6, 0.9]),
        [0.2, 0.2, 0.6, 0.9]
    );
    assert_eq!(
        left([6, 0, 6, 6], [0.9, 0.5, 0.8, 0.1]),
        [0.9, 0.5, 0.8, 0.1]
    );
    // What is unknown itself says nothing.
    assert_eq!(
        left([0, 0, 0, 0], [0.1, 0.5, 0.2, 0.3]),
        [0.1, 0.5, 0.2, 0.3]
    );
}

#[test]
fn views_from_behind_are_not_asked() {
    let edge = LineSegment3::new(Vector3::zeros(), Vector3::new(0.5, 0.0, 0.0));
    let mut all = cameras();
    all.push(camera_looking_at_origin(&Vector3::new(0.3, 0.4, -2.5)));
    let asked = |first: usize| {
        let views: Vec<usize> = (first..13).collect();
        let frame = EdgeFrame::new(edge, &views, &all).unwrap();
        frame
            .asked_views()
            .map(|(view, _)| view)
            .collect::<Vec<_>>()
    };
    assert_eq!(asked(0).len(), 12);
    assert!(!asked(0).contains(&12));
    assert_eq!(asked(12), [12]);
}

#[test]
fn what_is_seen_under_a_flat_angle_is_followed_farther() {
    let edge = LineSegment3::new(Vector3::zeros(), Vector3::new(0.5, 0.0, 0.0));
    // One camera, 30° above the plane z = 0 behind the edge.
    let camera = camera_looking_at_origin(&Vector3::new(0.25, -3f64.sqrt(), 1.0));
    let frame = EdgeFrame::new(edge, &[0], &[camera]).unwrap();
    let into = Side::BOTH
        .iter()
        .flat_map(|side| (0..HALF_PLANES).map(|index| frame.pixel_into(*side, index)));
    let shown = |into: Vector3<f64>| {
        let middle = edge.point_at(0.5);
        (camera.project(&(middle + into)).pixel - camera.project(&middle).pixel).norm()
    };
    let lengths: Vec<f64> = into.map(shown).collect();
    assert!(
        lengths.iter().all(|length| (length - 1.0).abs() < 0.01),
        "{lengths:?}"
    );
}

#[test]
fn junctions_have_types_and_edges_leave_planes() {
    let point = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
    // A bar along x that another one ends on, and at its end a corner; an L in a plane.
    let wireframe = Wireframe3d {
        junctions: vec![
            point(0.0, 0.0, 0.0),
            point(1.0, 0.0, 0.0),
            point(2.0, 0.0, 0.0),
            point(1.0, 1.0, 0.0),
            point(2.0, 1.0, 0.0),
            point(2.0, 0.0, 1.0),
            point(0.0, -1.0, 0.0),
        ],
        edges: vec![[0, 1], [1, 2], [3, 1], [2, 4], [2, 5], [0, 6]],
    };
    use JunctionType::{Corner, End, Planar, Tee};
    let types = junction_types(&wireframe);
    assert_eq!(types, [Planar, Tee, Corner, End, End, End, End]);
    let directions: Vec<_> = (wireframe.segments().iter())
        .map(|segment| (segment.end - segment.start).try_normalize(0.0))
        .collect();
    let leaving = leaves_plane(&wireframe, &directions);
    let expected = [0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
    for (found, expected) in leaving.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{leaving:?}");
    }
}

#[test]
fn as_many_edges_are_sampled_at_once_as_memory_holds() {
    let views: Vec<usize> = (0..12).collect();
    let edge = LineSegment3::new(Vector3::zeros(), Vector3::new(0.5, 0.0, 0.0));
    let frame = EdgeFrame::new(edge, &views, &cameras());
    let bytes = sampled_bytes(frame.as_ref().unwrap());
    assert!(bytes > 0);
    let frames = [frame.clone(), None, frame.clone(), frame];
    assert_eq!(so_many_at_once(&frames, 3 * bytes), 4);
    assert_eq!(so_many_at_once(&frames, 3 * bytes - 1), 3);
    assert_eq!(so_many_at_once(&frames, bytes), 2);
    assert_eq!(so_many_at_once(&frames, 0), 1);
}
