//! Nothing that a file can hold makes the back end panic or answer nonsense.

use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{Camera, Intrinsics, LineSegment2, LineSegment3, ScoredSegment2};
use neat_wireframe::line_tracks::{
    Line3dConfig, LineTracksConfig, LineTracksResult, line3d, run, wireframe_of_segments,
};
use neat_wireframe::validity::check_wireframe;
use neat_wireframe::{SegmentProposal, ViewObservation};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Mostly plain numbers, sometimes none.
fn number(range: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => range,
        1 => prop::sample::select(vec![
            0.0, -0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e-300,
        ]),
    ]
}

fn camera() -> impl Strategy<Value = Camera> {
    (
        prop_oneof![
            // Few places, so that centres coincide.
            prop::sample::select(vec![[0.0, 0.0, -3.0], [1.0, 0.0, -3.0], [0.0, 0.0, 0.0]]),
            prop::array::uniform3(-4.0..4.0_f64),
            [number(-4.0..4.0), number(-4.0..4.0), number(-4.0..4.0)],
        ],
        number(50.0..1000.0),
        prop::bool::weighted(0.1),
        prop::sample::select(vec![0, 1, 200, 400]),
    )
        .prop_map(|(center, focal, mirrored, size)| {
            let center_in_world = Vector3::from(center);
            let forward = (-center_in_world)
                .try_normalize(1e-9)
                .unwrap_or(Vector3::z());
            let side = Vector3::ith(if forward.z.abs() < 0.9 { 2 } else { 0 }, 1.0);
            let right = forward.cross(&side).normalize() * if mirrored { -1.0 } else { 1.0 };
            let down = forward.cross(&right);
            Camera {
                intrinsics: Intrinsics {
                    fx: focal,
                    fy: focal,
                    cx: 200.0,
                    cy: 200.0,
                    skew: 0.0,
                },
                world_from_camera: Matrix3::from_columns(&[right, down, forward]),
                center_in_world,
                width: size,
                height: 400,
            }
        })
}

fn view() -> impl Strategy<Value = ViewObservation> {
    let coordinate = || {
        prop_oneof![
            4 => number(0.0..400.0),
            // Few values: duplicates, and segments without length.
            1 => prop::sample::select(vec![10.0, 200.0, 390.0]),
        ]
    };
    let segment = [coordinate(), coordinate(), coordinate(), coordinate()];
    (
        camera(),
        prop::collection::vec((segment, number(0.0..1.0)), 0..25),
    )
        .prop_map(|(camera, segments)| ViewObservation {
            camera,
            segments: segments
                .into_iter()
                .enumerate()
                .map(|(edge, ([a, b, c, d], score))| ScoredSegment2 {
                    segment: LineSegment2::new(Vector2::new(a, b), Vector2::new(c, d)),
                    score,
                    edge,
                })
                .collect(),
            junctions: Vec::new(),
        })
}

fn proposal() -> impl Strategy<Value = SegmentProposal> {
    (
        0..8_usize,
        0..30_usize,
        [number(-1.0..1.0), number(-1.0..1.0), number(-1.0..1.0)],
        number(0.0..0.1),
    )
        .prop_map(|(view, segment_in_view, start, spread)| SegmentProposal {
            view,
            segment_in_view,
            segment: LineSegment3::new(start.into(), Vector3::new(0.1, 0.2, 0.3)),
            end_error_in_pixels: [1.0; 2],
            end_spread: [spread; 2],
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn any_input_gives_a_valid_graph(
        views in prop::collection::vec(view(), 0..6),
        copies in 0..3_usize,
        proposals in prop::collection::vec(proposal(), 0..10),
        radius in number(0.5..2.0),
    ) {
        let mut views = views;
        if let Some(first) = views.first().cloned() {
            views.extend(std::iter::repeat_n(first, copies));
        }
        let config = LineTracksConfig {
            min_views: 2,
            ..Default::default()
        };
        let result = run(&views, &proposals, None, radius, &config);
        let wireframe = &result.wireframe;
        prop_assert!(check_wireframe(&wireframe.junctions, &wireframe.edges).is_ok());
        prop_assert_eq!(wireframe.edges.len(), result.edges.len());
        for support in result.edges.iter().flat_map(|edge| &edge.supports) {
            prop_assert!(support.segment_in_view < views[support.view].segments.len());
        }
        let baseline = line3d(&views, radius, &Line3dConfig { min_views: 2, ..Default::default() });
        let wireframe = wireframe_of_segments(&baseline);
        prop_assert!(check_wireframe(&wireframe.junctions, &wireframe.edges).is_ok());
    }
}

/// What happens to the segments of a good scene.
#[derive(Clone, Copy, Debug)]
enum Damage {
    RepeatSegment,
    ReplaceCoordinate(f64),
    CollapseSegment,
    CopyCamera,
    MirrorCamera,
    TurnAround,
    EmptyView,
}

fn damage() -> impl Strategy<Value = (usize, usize, Damage)> {
    let kind = prop_oneof![
        4 => Just(Damage::RepeatSegment),
        4 => number(-100.0..600.0).prop_map(Damage::ReplaceCoordinate),
        2 => Just(Damage::CollapseSegment),
        2 => Just(Damage::CopyCamera),
        1 => Just(Damage::MirrorCamera),
        1 => Just(Damage::TurnAround),
        1 => Just(Damage::EmptyView),
    ];
    (0..1000_usize, 0..1000_usize, kind)
}

fn apply(views: &mut [ViewObservation], (view, segment, damage): (usize, usize, Damage)) {
    let view = view % views.len();
    let other_camera = views[segment % views.len()].camera;
    let ViewObservation {
        camera, segments, ..
    } = &mut views[view];
    let Some(index) = segment.checked_rem(segments.len()) else {
        return;
    };
    match damage {
        Damage::RepeatSegment => segments.push(segments[index]),
        Damage::ReplaceCoordinate(x) => segments[index].segment.end.x = x,
        Damage::CollapseSegment => segments[index].segment.end = segments[index].segment.start,
        Damage::CopyCamera => *camera = other_camera,
        Damage::MirrorCamera => camera.world_from_camera *= -1.0,
        Damage::TurnAround => camera.center_in_world *= -1.0,
        Damage::EmptyView => segments.clear(),
    }
}

/// Few, coarse views of a box, so that many cases run.
fn good_views() -> (Vec<ViewObservation>, f64) {
    let config = SyntheticScene {
        solid: Solid::Box,
        views: 12,
        image_size: 64,
        noise_in_pixels: 0.1,
        false_segments: 1,
        shading: false,
        ..Default::default()
    };
    let scene = generate(&config).unwrap().scene;
    let radius = scene.sphere_radius;
    (ViewObservation::from_scene(&scene, 0.0), radius)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_damaged_scene_gives_a_valid_graph(
        damages in prop::collection::vec(damage(), 0..30),
        min_views in 0..4_usize,
    ) {
        static VIEWS: LazyLock<(Vec<ViewObservation>, f64)> = LazyLock::new(good_views);
        let (mut views, radius) = VIEWS.clone();
        for damage in damages {
            apply(&mut views, damage);
        }
        let config = LineTracksConfig {
            min_views,
            ..Default::default()
        };
        let result = run(&views, &[], None, radius, &config);
        let wireframe = &result.wireframe;
        prop_assert!(check_wireframe(&wireframe.junctions, &wireframe.edges).is_ok());
        prop_assert!(wireframe.segments().iter().all(|segment| segment.length() > 0.0));
        let baseline = line3d(&views, radius, &Line3dConfig { min_views, ..Default::default() });
        prop_assert!(baseline.iter().all(|line| line.segment.length() > 0.0));
    }
}

#[test]
fn without_views_or_a_radius_there_is_nothing() {
    let config = LineTracksConfig::default();
    let nothing = run(&[], &[], None, 1.0, &config);
    assert_eq!(nothing.wireframe, Default::default());
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(
            run(&[], &[], None, radius, &config),
            LineTracksResult::default()
        );
    }
}
