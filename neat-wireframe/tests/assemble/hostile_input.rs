//! Nothing that a file can hold makes the assembler panic or answer nonsense.

use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{Camera, Edgel, EdgelMap, Intrinsics, LineSegment2, ScoredSegment2};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{
    AssembleConfig, Assembled, Line3dConfig, assemble, line3d, wireframe_of_segments,
};
use neat_wireframe::validity::check_wireframe;
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

/// Edgels of one view: on few rows, so that some of them are lines.
fn edgels() -> impl Strategy<Value = Vec<Edgel>> {
    let row = || prop::sample::select(vec![10.0, 200.0, 200.5, 390.0]);
    let edgel = prop_oneof![
        8 => (number(0.0..400.0), row()).prop_map(|(x, y)| [x, y, 0.0, 1.0]),
        4 => prop::array::uniform4(number(-10.0..410.0)),
    ];
    let edgel = edgel.prop_map(|values| {
        let [x, y, across, down] = values.map(|value| value as f32);
        Edgel {
            position: Vector2::new(x, y),
            normal: Vector2::new(across, down),
        }
    });
    prop::collection::vec(edgel, 0..60)
}

/// Mostly what a person may choose, sometimes not.
fn config() -> impl Strategy<Value = AssembleConfig> {
    let numbers = (number(-1.0..8.0), number(0.0..30.0), number(0.5..3.0));
    let rest = (any::<bool>(), 0..12_usize);
    (numbers, rest).prop_map(|(numbers, (refine_poses, neighbours))| {
        let (min_evidence, min_length, ball_margin) = numbers;
        AssembleConfig {
            refine_poses,
            min_evidence,
            min_segment_length_in_pixels: min_length,
            ball_margin,
            neighbours,
            ..AssembleConfig::default()
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn any_input_gives_a_valid_graph(
        views in prop::collection::vec(view(), 0..6),
        copies in 0..3_usize,
        edgels in prop::collection::vec(edgels(), 8),
        with_edgels in any::<bool>(),
        radius in number(0.5..2.0),
        config in config(),
    ) {
        let mut views = views;
        if let Some(first) = views.first().cloned() {
            views.extend(std::iter::repeat_n(first, copies));
        }
        let maps: Vec<EdgelMap> = (views.iter().zip(&edgels))
            .filter(|_| with_edgels)
            .map(|(view, edgels)| EdgelMap::new(edgels, view.camera.width, view.camera.height))
            .collect();
        let wireframe = assemble(&views, &maps, radius, &config).wireframe;
        prop_assert!(check_wireframe(&wireframe.junctions, &wireframe.edges).is_ok());
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
        let wireframe = assemble(&views, &[], radius, &AssembleConfig::default()).wireframe;
        prop_assert!(check_wireframe(&wireframe.junctions, &wireframe.edges).is_ok());
        prop_assert!(wireframe.segments().iter().all(|segment| segment.length() > 0.0));
        let baseline = line3d(&views, radius, &Line3dConfig { min_views, ..Default::default() });
        prop_assert!(baseline.iter().all(|line| line.segment.length() > 0.0));
    }
}

#[test]
fn without_views_or_a_radius_there_is_nothing() {
    let config = AssembleConfig::default();
    let nothing = assemble(&[], &[], 1.0, &config);
    assert_eq!(nothing.wireframe, Default::default());
    let (views, _) = good_views();
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(assemble(&views, &[], radius, &config), Assembled::default());
    }
}

#[test]
fn edgels_of_another_number_of_views_give_nothing() {
    let (views, radius) = good_views();
    let config = AssembleConfig::default();
    for count in [1, views.len() - 1, views.len() + 1] {
        let maps = vec![EdgelMap::default(); count];
        let built = assemble(&views, &maps, radius, &config);
        assert_eq!(built, Assembled::default());
    }
    // Images without an edge show nothing.
    let blank = vec![EdgelMap::default(); views.len()];
    let built = assemble(&views, &blank, radius, &config);
    assert!(built.wireframe.edges.is_empty());
}
