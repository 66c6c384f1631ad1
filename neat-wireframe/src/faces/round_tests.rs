//! Faces that are no planes: cylinders with notches and holes, walls between splines.

use super::tests::{Model, UNIT, WHOLE, assert_solid, of_triangles};
use crate::dimensions::Dimensions;
use crate::export::WireframeDocument;
use nalgebra::Vector3;
use neat_core::Spline;
use std::f64::consts::{PI, TAU};

/// A cylinder of radius 0.5 and height 1 without the quarter over `step` between the directions of
/// x and y.
fn notched(step: f64) -> Model {
    let mut model = Model::default();
    let places = [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]];
    for height in [1.0, step] {
        let at = places.map(|[x, y]| Vector3::new(x, y, height));
        model.wireframe.junctions.extend(at);
    }
    model.wireframe.edges = [[0, 1], [0, 2], [3, 4], [3, 5], [0, 3], [1, 4], [2, 5]].to_vec();
    model
        .circle([0.0, 0.0, 0.0], 0.5, WHOLE)
        .circle([0.0, 0.0, 1.0], 0.5, [0.25 * TAU, TAU])
        .circle([0.0, 0.0, step], 0.5, [0.0, 0.25 * TAU])
}

/// A pipe of radius 0.2 that ends at x = 1, on a closed cylinder of radius 0.5 from z = -1 to 1.
pub(super) fn tee() -> Model {
    let meeting = |share: f64| {
        let (sine, cosine) = (TAU * share).sin_cos();
        let (y, z) = (0.2 * cosine, 0.2 * sine);
        Vector3::new((0.25_f64 - y * y).sqrt(), y, z)
    };
    let mut model = Model::default()
        .circle([0.0, 0.0, -1.0], 0.5, WHOLE)
        .circle([0.0, 0.0, 1.0], 0.5, WHOLE)
        .circle([1.0, 0.0, 0.0], 0.2, WHOLE);
    model.arcs[2].axes = [Vector3::y(), Vector3::z()];
    model.splines = Spline::nearest_to(meeting, 16, true).into_iter().collect();
    model
}

/// Of the tee: the pipe begins where the cylinder ends.
fn volume_of_tee() -> f64 {
    let steps = 2000;
    let inside: f64 = (0..steps)
        .map(|k| {
            let y = 0.2 * ((f64::from(k) + 0.5) / f64::from(steps) * 2.0 - 1.0);
            (0.25 - y * y).sqrt() * 2.0 * (0.04 - y * y).sqrt() * 0.4 / f64::from(steps)
        })
        .sum();
    PI * 0.25 * 2.0 + PI * 0.04 - inside
}

#[test]
fn a_rim_may_go_up_and_down() {
    for step in [0.3, 0.6] {
        let volume = PI * 0.25 * (1.0 - 0.25 * (1.0 - step));
        assert_solid(notched(step), 6, volume);
        let (cut, watertight) = of_triangles(&notched(step).turned());
        assert!(watertight && (cut / UNIT / volume - 1.0).abs() < 2e-3);
    }
}

#[test]
fn a_notch_may_begin_where_the_other_rim_does() {
    // Neither of them is turned, so that their corners are at one angle.
    for angles in [[0.0, TAU], [0.25 * TAU, 1.25 * TAU], [0.5, 0.5 + TAU]] {
        let mut model = notched(0.6);
        model.arcs[0].angles = angles;
        let (cut, watertight) = of_triangles(&model);
        assert!(
            watertight && (cut / (PI * 0.225) - 1.0).abs() < 2e-3,
            "{angles:?}: {cut}"
        );
    }
}

#[test]
fn a_pipe_meets_another_one() {
    let exact = volume_of_tee();
    let (faces, volume) = tee().turned().solid();
    assert_eq!(faces, 5);
    assert!((volume / UNIT / exact - 1.0).abs() < 1e-4, "{volume}");
    let (cut, watertight) = of_triangles(&tee().turned());
    assert!(watertight);
    assert!((cut / UNIT / exact - 1.0).abs() < 2e-3, "{cut}");
    let model = tee().turned();
    let shell = &model.shells()[0];
    let geometry = model.geometry(shell);
    for face in &shell.faces {
        for point in face.steps().flat_map(|step| geometry.points(step, 0.01)) {
            assert!(face.surface.height_of(&point).0.abs() < 1e-4);
        }
    }
}

#[test]
fn the_dimension_of_a_notched_wall_is_its_area() {
    let model = notched(0.6).turned();
    let shells = model.shells();
    let geometry = model.geometry(&shells[0]);
    let areas: Vec<f64> = shells[0]
        .faces
        .iter()
        .map(|face| geometry.area(face))
        .collect();
    let document = WireframeDocument {
        arcs: model.arcs.clone(),
        shells: shells.clone(),
        ..WireframeDocument::from(&model.wireframe)
    };
    let measured = Dimensions::new(&document, None).unwrap().areas();
    assert!(
        areas
            .iter()
            .any(|area| (area / UNIT * 1.7 - 0.9 * PI).abs() < 1e-9)
    );
    for (area, dimension) in areas.iter().zip(&measured) {
        assert!((area - dimension.value).abs() < 1e-9);
    }
}

/// Splines around an ellipse with half axes of .3 and .2, at two heights; the second one begins
/// elsewhere and runs the other way round.
fn pin(controls: usize) -> Model {
    let oval = |height: f64, first: f64, sign: f64| {
        let at = |share: f64| {
            let (sine, cosine) = (TAU * (first + sign * share)).sin_cos();
            Vector3::new(0.3 * cosine, 0.2 * sine, height)
        };
        Spline::nearest_to(at, controls, true).unwrap()
    };
    Model {
        splines: vec![oval(0.0, 0.0, 1.0), oval(0.7, 0.3, -1.0)],
        ..Model::default()
    }
}

#[test]
fn a_profile_leaves_a_wall_behind() {
    let exact = PI * 0.06 * 0.7;
    let (faces, volume) = pin(16).turned().solid();
    assert_eq!(faces, 3);
    assert!((volume / UNIT / exact - 1.0).abs() < 1e-4, "{volume}");
    let (cut, watertight) = of_triangles(&pin(16).turned());
    assert!(
        watertight && (cut / UNIT / exact - 1.0).abs() < 5e-3,
        "{cut}"
    );
    // On a drum: the rim there is no plane's, whichever comes first.
    for swapped in [false, true] {
        let mut boss = Model::default()
            .circle([0.0, 0.0, -1.0], 0.5, WHOLE)
            .circle([0.0, 0.0, 1.0], 0.5, WHOLE);
        let oval = |x: &dyn Fn(f64) -> f64| {
            let at = |share: f64| {
                let (sine, cosine) = (TAU * share).sin_cos();
                Vector3::new(x(0.2 * cosine), 0.2 * cosine, 0.3 * sine)
            };
            Spline::nearest_to(at, 16, true).unwrap()
        };
        boss.splines = vec![oval(&|_| 1.0), oval(&|y| (0.25 - y * y).sqrt())];
        if swapped {
            boss.splines.reverse();
        }
        let (faces, volume) = boss.turned().solid();
        assert_eq!(faces, 5);
        // As of the round pipe, half as wide again.
        let exact = PI * 0.5 + 1.5 * (volume_of_tee() - PI * 0.5);
        assert!(
            (volume / UNIT / exact - 1.0).abs() < 1e-4,
            "{}",
            volume / UNIT - exact
        );
    }
    // Through a block: a hole.
    let mut block = Model::default().prism(
        &[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]],
        [0.0, 0.7],
    );
    block.splines = pin(16).splines;
    let (faces, volume) = block.clone().turned().solid();
    assert_eq!(faces, 7);
    assert!((volume / UNIT - 2.8 + exact).abs() < 1e-4, "{volume}");
    let (cut, watertight) = of_triangles(&block.turned());
    assert!(
        watertight && (cut / UNIT - 2.8 + exact).abs() < 2e-3,
        "{cut}"
    );
}

#[test]
fn a_wall_may_end_at_edges_and_be_cut_askew() {
    // Half the pin, and its upper end not across it.
    let half = |height: f64, slope: f64| {
        let at = |share: f64| {
            let (sine, cosine) = (PI * share).sin_cos();
            Vector3::new(0.3 * cosine, 0.2 * sine, height + slope * 0.3 * cosine)
        };
        Spline::nearest_to(at, 10, false).unwrap()
    };
    let mut model = Model {
        splines: vec![half(0.0, 0.0), half(0.7, 0.4)],
        ..Model::default()
    };
    let ends = model
        .splines
        .iter()
        .flat_map(|spline| [spline.controls[0], spline.controls[9]]);
    model.wireframe.junctions = ends.collect();
    model.wireframe.edges = vec![[0, 1], [2, 3], [0, 2], [1, 3]];
    let (faces, volume) = model.clone().turned().solid();
    assert_eq!(faces, 4);
    let exact = 0.5 * PI * 0.06 * 0.7;
    assert!((volume / UNIT / exact - 1.0).abs() < 1e-3, "{volume}");
    let model = model.turned();
    let shells = model.shells();
    let geometry = model.geometry(&shells[0]);
    let document = WireframeDocument {
        splines: model.splines.clone(),
        shells: shells.clone(),
        ..WireframeDocument::from(&model.wireframe)
    };
    let measured = Dimensions::new(&document, None).unwrap().areas();
    for (face, dimension) in shells[0].faces.iter().zip(&measured) {
        let area = geometry.area(face);
        assert!((area / dimension.value - 1.0).abs() < 1e-3, "{area}");
    }
}

#[test]
fn pipes_of_one_radius_touch_where_they_meet() {
    // In two halves of ellipses, at whose ends both surfaces are one.
    let half = |sign: f64| {
        let at = move |share: f64| {
            let (sine, cosine) = (PI * share).sin_cos();
            Vector3::new(0.5 * sine, 0.5 * cosine, 0.5 * sign * sine)
        };
        Spline::nearest_to(at, 12, false).unwrap()
    };
    let mut model = tee();
    model.splines = vec![half(1.0), half(-1.0)];
    model.arcs[2].radius = 0.5;
    model.wireframe.junctions = [0.5, -0.5].map(|y| Vector3::new(0.0, y, 0.0)).to_vec();
    let (faces, volume) = model.clone().turned().solid();
    assert_eq!(faces, 5);
    let exact = PI * 0.25 * 3.0 - 8.0 / 3.0 * 0.125;
    assert!((volume / UNIT / exact - 1.0).abs() < 1e-4, "{volume}");
    let (cut, watertight) = of_triangles(&model.turned());
    assert!(
        watertight && (cut / UNIT / exact - 1.0).abs() < 2e-3,
        "{cut}"
    );
}
