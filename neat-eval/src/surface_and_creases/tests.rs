//! A cube whose numbers are known, and input that cannot be measured.

use super::*;
use crate::triangle_mesh::TriangleMesh;
use crate::triangle_mesh::tests::cube;

const EDGES: [[usize; 2]; 12] = [
    [0, 1],
    [1, 2],
    [2, 3],
    [3, 0],
    [4, 5],
    [5, 6],
    [6, 7],
    [7, 4],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

/// The unit cube, with a painted line across its top and a bent crease of two pieces in it.
fn truth() -> SceneTruth {
    let at = Vector3::new;
    SceneTruth {
        wireframe: Wireframe3d {
            junctions: cube().vertices,
            edges: EDGES.to_vec(),
        },
        edge_views: Some(vec![9, 9, 9, 9, 9, 9, 9, 9, 3, 3, 2, 2]),
        curves: vec![vec![
            at(0.3, 0.2, 0.0),
            at(0.5, 0.2, 0.0),
            at(0.69, 0.26, 0.0),
        ]],
        texture_lines: vec![LineSegment3::new(at(0.0, 0.5, 1.0), at(1.0, 0.5, 1.0))],
        surface: cube(),
        ..SceneTruth::default()
    }
}

fn evaluate(predicted: &Wireframe3d, truth: &SceneTruth) -> CreaseScores {
    SurfaceAndCreases::default()
        .evaluate(predicted, truth)
        .unwrap()
}

fn close(found: Option<f64>, expected: f64) {
    let found = found.unwrap();
    assert!((found - expected).abs() < 1e-9, "{found} is not {expected}");
}

#[test]
fn the_truth_is_perfect() {
    let truth = truth();
    let scores = evaluate(&truth.wireframe, &truth);
    assert_eq!((scores.predicted.edges, scores.truth.junctions), (12, 8));
    assert_eq!(scores.junction_accuracy.unwrap().mean, 0.0);
    for shares in &scores.thresholds {
        close(shares.completeness, 1.0);
        close(shares.junction_precision, 1.0);
        close(shares.length_on_straight_crease, 1.0);
        close(shares.completeness_of_curved, 0.0);
        close(Some(shares.f1), 1.0);
    }
    // All edges are one metre long.
    let lengths = scores.by_length.iter().map(|bin| bin.length.round());
    assert_eq!(lengths.collect::<Vec<_>>(), [0.0, 0.0, 12.0, 0.0]);
    assert_eq!(scores.by_length[0].recall, None);
}

#[test]
fn a_damaged_cube_has_the_numbers_of_its_damage() {
    let truth = truth();
    // All 1.5 cm too high; the last three edges are not found.
    let up = Vector3::new(0.0, 0.0, 0.015);
    let mut predicted = truth.wireframe.map(|p| p + up);
    predicted.edges.truncate(9);
    // On the painted line; across a lower edge; in the middle of the cube, half a metre from
    // its surface.
    for [x, y, z, dx, dy] in [
        [0.1, 0.5, 1.0, 0.5, 0.0],
        [0.5, 0.0, 0.0, 0.0, 0.5],
        [0.5, 0.5, 0.5, 0.0, 0.0],
    ] {
        let first = predicted.junctions.len();
        let start = Vector3::new(x, y, z);
        predicted
            .junctions
            .extend([start, start + Vector3::new(dx, dy, 0.0)]);
        predicted.edges.push([first, first + 1]);
    }
    let scores = evaluate(&predicted, &truth);
    // The last edge is a point: its junctions count, the edge does not.
    assert_eq!(
        (scores.predicted.junctions, scores.predicted.edges),
        (14, 11)
    );
    assert!((scores.predicted.length - 10.0).abs() < 1e-12);
    let [at_1, at_2, _] = &scores.thresholds[..] else {
        panic!("three thresholds");
    };
    // The upper junctions are 1.5 cm above the cube, the lower ones in its walls.
    close(
        scores.junction_accuracy.map(|of| of.mean),
        (4.0 * 0.015 + 2.0 * 0.5) / 14.0,
    );
    close(scores.junction_accuracy.map(|of| of.median), 0.0);
    close(at_1.junctions_on_surface, 8.0 / 14.0);
    close(at_2.junctions_on_surface, 12.0 / 14.0);
    // Four edges of eleven above the top, and the 1.5 cm of the upright one that stands out:
    // no sample of 32 but its end.
    close(at_1.points_on_surface, (7.0 * 32.0 - 1.0) / (11.0 * 32.0));
    close(
        scores.segment_accuracy.map(|of| of.mean),
        0.015 * (4.0 * 32.0 + 1.0) / (11.0 * 32.0),
    );
    // At 1 cm only the upright edge is followed, but for its first half centimetre: the sample
    // there is 1 cm away or not, by rounding. At 2 cm all nine are.
    let upright = at_1.completeness.unwrap() * 12.0;
    assert!((0.98..1.0 + 1e-9).contains(&upright), "{upright}");
    close(at_2.completeness, 9.0 / 12.0);
    close(at_2.completeness_of_long, 9.0 / 12.0);
    close(at_2.junction_recall, 1.0);
    close(at_1.junction_recall, 0.0);
    close(at_2.junction_precision, 8.0 / 14.0);
    // The line across a lower edge crosses it, which is no find; the painted line is no crease.
    close(at_2.length_on_straight_crease, 0.9);
    close(at_2.length_on_crease, 0.9);
    close(at_2.length_on_crease_or_texture, 0.95);
    close(Some(at_2.f1), 2.0 * 0.9 * 0.75 / 1.65);
    // Edges 0 to 8 of views 9 and 3 are found, 9 to 11 are not.
    let by_views = scores.by_views.as_ref().unwrap();
    let of_views = |bin: usize| by_views[bin].recall.as_ref().map(|recall| recall[1]);
    assert_eq!((of_views(0), of_views(2)), (Some(0.0), None));
    close(of_views(1), 0.5);
    close(of_views(3), 1.0);
}

#[test]
fn curves_allow_twice_the_angle() {
    let truth = truth();
    // Turned by 15° against the first piece and by 2.5° against the second.
    let (sin, cos) = 15_f64.to_radians().sin_cos();
    let start = Vector3::new(0.5, 0.2, 0.0);
    let turned = Wireframe3d {
        junctions: vec![start, start + 0.15 * Vector3::new(cos, sin, 0.0)],
        edges: vec![[0, 1]],
    };
    let scores = evaluate(&turned, &truth);
    let [at_1, .., at_5] = &scores.thresholds[..] else {
        panic!("three thresholds");
    };
    close(at_1.length_on_crease, 1.0);
    close(at_1.length_on_straight_crease, 0.0);
    // 5 cm before the bend, as far as the threshold reaches, and what lies beside it behind.
    let curved = at_5.completeness_of_curved.unwrap() * (0.2 + 0.19_f64.hypot(0.06));
    assert!((curved - 0.25).abs() < 0.02, "{curved}");
}

#[test]
fn the_scale_is_that_of_thresholds_spacing_and_bins() {
    let big = truth();
    let predicted = big.wireframe.map(|p| p * 1.003);
    let half = |wireframe: &Wireframe3d| wireframe.map(|p| p * 0.5);
    let small = SceneTruth {
        scale: 0.5,
        wireframe: half(&big.wireframe),
        curves: vec![big.curves[0].iter().map(|p| p * 0.5).collect()],
        texture_lines: Vec::new(),
        surface: TriangleMesh {
            vertices: cube().vertices.iter().map(|p| p * 0.5).collect(),
            ..cube()
        },
        ..truth()
    };
    let of_big = evaluate(&predicted, &big);
    let of_small = evaluate(&half(&predicted), &small);
    for (big, small) in of_big.thresholds.iter().zip(&of_small.thresholds) {
        assert_eq!(small.threshold, 0.5 * big.threshold);
        close(small.completeness, big.completeness.unwrap());
        close(small.length_on_surface, big.length_on_surface.unwrap());
    }
    assert_eq!(of_small.by_length[2].to, Some(0.5));
    close(of_small.by_length[2].recall.as_ref().map(|r| r[2]), 1.0);
}

#[test]
fn nothing_found_scores_nothing() {
    let scores = evaluate(&Wireframe3d::default(), &truth());
    assert_eq!(
        (scores.junction_accuracy, scores.segment_accuracy),
        (None, None)
    );
    let shares = scores.thresholds[2];
    assert_eq!(
        (shares.completeness, shares.junction_recall),
        (Some(0.0), Some(0.0))
    );
    assert_eq!(
        (
            shares.length_on_crease,
            shares.junction_precision,
            shares.f1
        ),
        (None, None, 0.0)
    );
    // Without curves there is no share of them.
    let straight = SceneTruth {
        curves: Vec::new(),
        ..truth()
    };
    let scores = evaluate(&straight.wireframe, &straight);
    assert_eq!(scores.thresholds[0].completeness_of_curved, None);
}

#[test]
fn bad_input_is_refused_with_a_reason() {
    let message = |predicted: &Wireframe3d, change: fn(&mut SceneTruth)| {
        let mut truth = truth();
        change(&mut truth);
        let error = SurfaceAndCreases::default()
            .evaluate(predicted, &truth)
            .unwrap_err();
        neat_core::with_causes(&error)
    };
    let good = truth().wireframe;
    let refused = |change: fn(&mut SceneTruth), reason: &str| {
        let message = message(&good, change);
        assert!(message.contains(reason), "{message}");
    };
    refused(|t| t.wireframe.edges.clear(), "the truth has no edges");
    refused(
        |t| t.surface.triangles.clear(),
        "the truth has no triangles",
    );
    refused(
        |t| t.surface.triangles[3][1] = 8,
        "triangle 3 of the true surface",
    );
    refused(|t| t.wireframe.edges[0][1] = 8, "edge 0 joins");
    refused(|t| t.curves[0][0].x = f64::NAN, "the truth is too large");
    refused(
        |t| t.surface.vertices[0].x = 1e200,
        "the truth is too large",
    );
    refused(
        |t| t.texture_lines[0].end.x = 1e29,
        "the truth is too large",
    );
    refused(|t| t.scale = 0.0, "check `scale`");
    refused(|t| t.scale = 1e-9, "the result is too large");
    for (number, reason) in [
        (f64::NAN, "not a finite point"),
        (1e200, "the result is too large"),
    ] {
        let mut broken = good.clone();
        broken.junctions[2].y = number;
        assert!(
            message(&broken, |_| ()).contains(reason),
            "{}",
            message(&broken, |_| ())
        );
    }
}
