//! What is said of scenes that have one fault or another.

mod real;

use neat_core::layout::{CameraAxes, PoseConvention};
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{LoadOptions, Scene, load_scene};
use neat_doctor::{
    Cause, Check, Depth, ExamineOptions, Level, Repair, Verdict, examine, examine_folder,
};
use proptest::prelude::*;
use real::real;
use std::fs;
use std::path::Path;

/// Reads scenes without asking for 2D wireframes.
fn load_options() -> LoadOptions {
    LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    }
}

fn synthetic(solid: Solid, views: usize) -> Scene {
    let config = SyntheticScene {
        solid,
        views,
        image_size: 400,
        ..SyntheticScene::default()
    };
    generate(&config).unwrap().scene
}

#[test]
fn all_solids_pass_at_both_depths() {
    for solid in Solid::POLYHEDRA {
        let scene = synthetic(solid, 40);
        for depth in [Depth::Quick, Depth::Full] {
            let options = ExamineOptions {
                depth,
                ..ExamineOptions::default()
            };
            let examination = examine(&scene, &options);
            assert_eq!(
                examination.verdict,
                Verdict::Ready,
                "{depth:?} {examination}"
            );
        }
    }
}

/// Most cameras within the scene sphere are a room, a few are a mistake.
#[test]
fn cameras_within_the_scene_sphere_are_in_a_room_or_wrong() {
    let of_sphere = |scene: &Scene| {
        let examination = examine(scene, &ExamineOptions::default());
        let findings = examination.findings.into_iter();
        let mut of_sphere = findings.filter(|finding| finding.check == Check::SceneSphere);
        let finding = of_sphere.next().unwrap();
        (finding.level, finding.views.len())
    };
    let mut scene = synthetic(Solid::POLYHEDRA[0], 40);
    assert_eq!(of_sphere(&scene), (Level::Good, 0));
    let radius = scene.sphere_radius;
    let distances = scene
        .views
        .iter()
        .map(|view| view.camera.center_in_world.norm());
    scene.sphere_radius = 1.2 * distances.fold(0.0, f64::max);
    assert_eq!(of_sphere(&scene), (Level::Note, 40));
    scene.sphere_radius = radius;
    let center = &mut scene.views[7].camera.center_in_world;
    *center *= 0.5 * radius / center.norm();
    assert_eq!(of_sphere(&scene), (Level::Warning, 1));
}

/// A dome without any corner; its silhouettes tell.
#[test]
fn a_smooth_thing_in_another_order_is_not_passed() {
    let Some(dir) = real("parts/part-007") else {
        return;
    };
    let mut scene = load_scene(&dir, &load_options()).unwrap().scene;
    let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
    for (index, view) in scene.views.iter_mut().enumerate() {
        view.camera = cameras[(7 * index + 3) % cameras.len()];
    }
    let examination = examine(&scene, &ExamineOptions::default());
    assert_eq!(examination.verdict, Verdict::NotReady, "{examination}");
}

/// Bricks and leaves look alike everywhere: few tracks are right even where the poses are.
#[test]
fn a_bad_pose_among_bricks_and_leaves_is_named_alone() {
    let Some(dir) = real("photoreal/house_1") else {
        return;
    };
    let mut scene = load_scene(&dir, &load_options()).unwrap().scene;
    let turn = nalgebra::Rotation3::from_euler_angles(0.0, 0.1, 0.0);
    scene.views[20].camera.world_from_camera *= turn.matrix();
    let examination = examine(&scene, &ExamineOptions::default());
    let problem = examination.problems().next().unwrap();
    assert_eq!(
        problem.views,
        [scene.views[20].name.as_str()],
        "{examination}"
    );
}

#[test]
fn a_quick_look_at_a_bad_scene_becomes_a_thorough_one() {
    let mut scene = synthetic(Solid::StairPrism, 40);
    for view in &mut scene.views {
        view.camera.intrinsics.fx *= 1.5;
        view.camera.intrinsics.fy *= 1.5;
    }
    let options = ExamineOptions {
        depth: Depth::Quick,
        ..ExamineOptions::default()
    };
    let examination = examine(&scene, &options);
    let problem = examination.problems().next().unwrap();
    assert_eq!(problem.cause, Some(Cause::FocalLength), "{examination}");
}

#[test]
fn two_images_that_traded_places_are_both_named() {
    let mut scene = synthetic(Solid::LPrism, 40);
    let (first, second) = (scene.views[4].camera, scene.views[9].camera);
    scene.views[4].camera = second;
    scene.views[9].camera = first;
    let examination = examine(&scene, &ExamineOptions::default());
    let problem = examination.problems().next().unwrap();
    assert_eq!(problem.cause, Some(Cause::ImageOrder), "{examination}");
    assert_eq!(problem.views, ["image_0004", "image_0009"]);
}

#[test]
fn images_sorted_as_text_and_poses_by_number_are_told_apart() {
    let mut scene = synthetic(Solid::LPrism, 40);
    for (index, view) in scene.views.iter_mut().enumerate() {
        view.name = format!("photo{}", index + 1);
    }
    // The poses stay in the order of the numbers, as from a list.
    let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
    scene.views.sort_by(|a, b| a.name.cmp(&b.name));
    for (view, camera) in scene.views.iter_mut().zip(cameras) {
        view.camera = camera;
    }
    let examination = examine(&scene, &ExamineOptions::default());
    let problem = examination.problems().next().unwrap();
    assert_eq!(problem.cause, Some(Cause::ImageOrder), "{examination}");
    assert!(problem.message.contains("follow the numbers"), "{problem}");
}

#[test]
fn remedies_take_the_place_of_flags_that_were_given() {
    let mut scene = synthetic(Solid::LPrism, 30);
    // OpenCV axes, but read as OpenGL's, and focal lengths doubled by a flag.
    let flip = nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, -1.0));
    for view in &mut scene.views {
        view.camera.world_from_camera *= flip;
        view.camera.intrinsics.fx *= 2.0;
        view.camera.intrinsics.fy *= 2.0;
    }
    let read_with = Repair {
        pose_convention: Some("right-up-back".parse().map(axes).unwrap()),
        focal_scale: Some(2.0),
        ..Repair::default()
    };
    let options = ExamineOptions {
        read_with,
        ..ExamineOptions::default()
    };
    let examination = examine(&scene, &options);
    let repair = examination.problems().next().unwrap().repair.unwrap();
    assert_eq!(repair.pose_convention, Some(PoseConvention::default()));
    assert!((repair.focal_scale.unwrap() - 1.0).abs() < 0.01, "{repair}");
}

fn axes(axes: CameraAxes) -> PoseConvention {
    PoseConvention {
        axes,
        ..PoseConvention::default()
    }
}

#[test]
fn images_without_anything_to_see_are_no_false_alarm() {
    let mut scene = synthetic(Solid::Box, 20);
    for view in &mut scene.views {
        // A round, soft spot: no corners.
        let (width, height) = view.image.dimensions();
        view.image = image::RgbImage::from_fn(width, height, |x, y| {
            let [x, y] = [(x, width), (y, height)]
                .map(|(at, extent)| f64::from(at) / f64::from(extent) - 0.5);
            image::Rgb([(255.0 * (-8.0 * (x * x + y * y)).exp()) as u8; 3])
        })
        .into();
    }
    let examination = examine(&scene, &ExamineOptions::default());
    let poses = examination
        .findings
        .iter()
        .find(|f| f.check == Check::Poses)
        .unwrap();
    assert_eq!(poses.cause, Some(Cause::TooLittleEvidence), "{examination}");
    assert_eq!(poses.level, Level::Note);
}

#[test]
fn scenes_of_one_or_two_views_are_examined() {
    for views in [1, 2, 3] {
        let examination = examine(&synthetic(Solid::Wedge, views), &ExamineOptions::default());
        assert_eq!(examination.views, views);
    }
}

#[test]
fn images_of_half_size_with_sizes_in_the_file_are_repaired_by_a_flag() {
    let dir = tempfile::tempdir().unwrap();
    let scene = synthetic(Solid::LPrism, 24);
    fs::create_dir(dir.path().join("images")).unwrap();
    let mut frames = Vec::new();
    for view in &scene.views {
        let file = format!("images/{}.png", view.name);
        let (width, height) = view.image.dimensions();
        let filter = image::imageops::FilterType::Triangle;
        let half =
            image::imageops::resize(&*view.image.read().unwrap(), width / 2, height / 2, filter);
        half.save(dir.path().join(&file)).unwrap();
        let rows = |m: &dyn Fn(usize, usize) -> f64, side: usize| -> Vec<Vec<f64>> {
            (0..side)
                .map(|i| (0..side).map(|j| m(i, j)).collect())
                .collect()
        };
        let (k, pose) = (
            view.camera.intrinsics.matrix(),
            view.camera.matrix_world_from_camera(),
        );
        frames.push(serde_json::json!({
            "file": file, "width": width, "height": height,
            "K": rows(&|i, j| k[(i, j)], 3), "c2w": rows(&|i, j| pose[(i, j)], 4),
        }));
    }
    let cameras = dir.path().join("cameras.json");
    fs::write(
        &cameras,
        serde_json::json!({ "frames": frames }).to_string(),
    )
    .unwrap();
    let examination = examine_folder(dir.path(), &load_options(), &ExamineOptions::default());
    let problem = examination.problems().next().unwrap();
    assert_eq!(problem.cause, Some(Cause::ResizedImages), "{examination}");
    let repair = problem.repair.unwrap();
    assert_eq!(repair.to_string(), "--intrinsics-scale 0.5");
    let repaired = repair.apply(&load_options());
    let examination = examine_folder(dir.path(), &repaired, &ExamineOptions::default());
    assert_eq!(examination.problems().count(), 0, "{examination}");

    // What Python writes for numbers that are none.
    let text = fs::read_to_string(&cameras)
        .unwrap()
        .replacen("1.0", "NaN", 1);
    fs::write(&cameras, text).unwrap();
    assert_eq!(first_cause(dir.path()), Some(Cause::NotFinite));
    fs::write(&cameras, "{\"frames\": [").unwrap();
    assert_eq!(first_cause(dir.path()), Some(Cause::DamagedFile));
    fs::remove_file(&cameras).unwrap();
    assert_eq!(first_cause(dir.path()), Some(Cause::MissingFile));
}

fn first_cause(dir: &Path) -> Option<Cause> {
    let examination = examine_folder(dir, &load_options(), &ExamineOptions::default());
    examination.problems().next()?.cause
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn cameras_of_any_kind_are_examined_without_panic(
        size in (1u32..70, 1u32..70),
        focal in -3.0..9.0f64,
        principal in prop::array::uniform2(-1e9..1e9f64),
        centers in prop::collection::vec(prop::array::uniform3(-1e12..1e12f64), 1..12),
        texture: u32,
    ) {
        let (width, height) = size;
        let mut scene = synthetic_frame(width, height, texture, centers.len());
        for (view, center) in scene.views.iter_mut().zip(&centers) {
            view.camera.intrinsics.fx = 10f64.powf(focal);
            [view.camera.intrinsics.cx, view.camera.intrinsics.cy] = principal;
            view.camera.center_in_world = (*center).into();
        }
        let examination = examine(&scene, &ExamineOptions::default());
        prop_assert!(examination.to_string().contains("Verdict"));
    }
}

/// Views of noise from one place.
fn synthetic_frame(width: u32, height: u32, texture: u32, views: usize) -> Scene {
    let config = SyntheticScene {
        views: 1,
        image_size: 16,
        ..SyntheticScene::default()
    };
    let mut scene = generate(&config).unwrap().scene;
    let first = scene.views.remove(0);
    for index in 0..views {
        let mut view = first.clone();
        view.name = format!("view{index:02}");
        (view.camera.width, view.camera.height) = (width, height);
        view.wireframe = neat_core::Wireframe2d::empty(width, height);
        view.image = image::RgbImage::from_fn(width, height, |x, y| {
            let mixed = (x * 7919 + y * 104_729)
                .wrapping_add(texture)
                .wrapping_mul(2_654_435_761);
            image::Rgb([(mixed >> 24) as u8; 3])
        })
        .into();
        scene.views.push(view);
    }
    scene
}

#[test]
fn the_number_of_threads_does_not_change_what_is_found() {
    let mut scene = synthetic(Solid::TPrism, 24);
    scene.views[5].camera = scene.views[6].camera;
    let examined = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| examine(&scene, &ExamineOptions::default()))
    };
    assert_eq!(examined(1), examined(3));
}
