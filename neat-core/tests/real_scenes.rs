//! Every real scene that is at hand loads. The data are not part of the
//! repository: set `NEAT_DATA`, or keep them in `../shared/data`.

use image::RgbImage;
use nalgebra::{Matrix3, Matrix4, Vector2, Vector3};
use neat_core::convert::{SceneFormat, convert};
use neat_core::ground_truth::{read_ground_truth, read_wireframe};
use neat_core::layout::Layout;
use neat_core::ply::read_points;
use neat_core::{
    Camera, LoadOptions, Scene, SceneError, SphereChoice, SphereSource, View, load_scene,
};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of a real scene, or `None`, said aloud, where there is none.
#[expect(clippy::print_stderr, reason = "a skipped test must be seen")]
fn real(scene: &str) -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let root = std::env::var_os("NEAT_DATA").map_or_else(|| default.into(), PathBuf::from);
    let dir = root.join(scene);
    if dir.is_dir() {
        return Some(dir);
    }
    eprintln!("skipped: no real data at {}", dir.display());
    None
}

#[test]
fn the_toy_object_has_its_known_numbers() {
    let Some(dir) = real("abc-00075213") else {
        return;
    };
    let loaded = load_scene(&dir, &LoadOptions::default()).unwrap();
    let scene = &loaded.scene;
    assert_eq!(loaded.layout, Layout::Abc);
    assert_eq!(loaded.warnings, []);
    assert_eq!(scene.name, "abc-00075213");
    assert_eq!(scene.views.len(), 100);
    assert_eq!(scene.pixel_center, 0.5);
    for view in &scene.views {
        assert_eq!((view.camera.width, view.camera.height), (512, 512));
        assert_eq!(view.camera.intrinsics.fx, 560.0);
        assert!((view.camera.center_in_world.norm() - 2.0).abs() < 1e-5);
        // Every camera looks at the origin.
        let pixel = view.camera.project(&Vector3::zeros()).pixel;
        assert!((pixel.add_scalar(-256.0)).amax() < 1e-2);
    }
    assert!((scene.sphere_radius - 1.0).abs() < 1e-2);
    assert_eq!(loaded.sphere.source, SphereSource::File);
    assert_eq!(scene.views[0].wireframe.vertices.len(), 8);
    assert_eq!(scene.views[0].wireframe.segments(0.05).len(), 9);
    assert_eq!(
        scene.views[0].wireframe.vertices[0].x,
        269.1760559082031 + 0.5
    );

    let truth = read_ground_truth(&dir.join("gt_wireframe.json")).unwrap();
    assert_eq!(truth.wireframe.junctions.len(), 12);
    assert_eq!(truth.wireframe.edges.len(), 18);
    // The truth agrees with what the detector saw, to a pixel.
    let segments = truth.wireframe.segments();
    let near = scene.views.iter().filter(|view| {
        let detected = view.wireframe.segments(0.5);
        segments.iter().any(|segment| {
            let projected = segment.map(|end| view.camera.project(end).pixel);
            detected
                .iter()
                .any(|found| projected.unordered_squared_end_distance(&found.segment) < 2.0)
        })
    });
    assert!(near.count() > 90);
}

#[test]
fn scenes_without_wireframes_name_the_remedy_and_load_without() {
    let scenes = [
        ("abc-00001776", 100, 0.5),
        ("abc-00003173", 100, 0.5),
        ("cad-0406", 100, 0.5),
        ("cad-three-concave", 100, 0.5),
        ("abcnef-00000952", 50, 0.0),
        ("abcnef-00004926", 49, 0.0),
        ("dtu-scan24", 49, 0.0),
        ("strecha-entry-P10", 10, 0.0),
        ("sceaux-castle", 10, 0.0),
    ];
    for (name, views, pixel_center) in scenes {
        let Some(dir) = real(name) else {
            continue;
        };
        let error = load_scene(&dir, &LoadOptions::default()).unwrap_err();
        assert!(
            matches!(error, SceneError::Missing { .. }),
            "{name}: {error}"
        );

        // The two files of poses say the same; photographs are large, so one
        // scene is held at a time, without its images.
        let layout = if name.starts_with("dtu") {
            Layout::Dtu
        } else {
            Layout::Abc
        };
        let cameras = [layout, Layout::CamerasJson].map(|layout| {
            let options = LoadOptions {
                layout: Some(layout),
                require_wireframes: false,
                sphere: SphereChoice::File,
                ..LoadOptions::default()
            };
            let scene = load_scene(&dir, &options).unwrap().scene;
            assert_eq!(scene.views.len(), views, "{name}");
            assert_eq!(scene.pixel_center, pixel_center, "{name}");
            let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
            (cameras, scene.original_from_world)
        });
        let [(npz, npz_frame), (json, json_frame)] = cameras;
        for (a, b) in npz.iter().zip(&json) {
            let poses = a.matrix_world_from_camera() - b.matrix_world_from_camera();
            assert!(poses.amax() < 1e-4, "{name}: {poses}");
            let k = a.intrinsics.matrix() - b.intrinsics.matrix();
            assert!(k.amax() < 1e-2, "{name}: {k}");
        }
        if layout == Layout::Dtu {
            let difference = npz_frame.matrix() - json_frame.matrix();
            assert!(difference.amax() < 1e-6, "{name}: {difference}");
            assert!((npz_frame.scale - 231.068).abs() < 1e-3);
        }
    }
}

/// A scene of Blender as it was made, and `cameras.json` made from it by others.
#[test]
fn blenders_transforms_agree_with_the_cameras_made_from_them() {
    let Some(dir) = real("abcnef-00000952") else {
        return;
    };
    // The images have got other names since; those of Blender are made again.
    let cameras = fs::read_to_string(dir.join("cameras.json")).unwrap();
    let cameras: serde_json::Value = serde_json::from_str(&cameras).unwrap();
    let blender = tempfile::tempdir().unwrap();
    fs::create_dir(blender.path().join("train")).unwrap();
    let transforms = "transforms_train.json";
    fs::copy(dir.join(transforms), blender.path().join(transforms)).unwrap();
    let mut expected = BTreeMap::new();
    for frame in cameras["frames"].as_array().unwrap() {
        let source = frame["source_name"].as_str().unwrap();
        let image = dir.join(frame["file"].as_str().unwrap());
        fs::copy(image, blender.path().join("train").join(source)).unwrap();
        expected.insert(source.strip_suffix(".png").unwrap(), frame);
    }

    let options = LoadOptions {
        require_wireframes: false,
        sphere: SphereChoice::File,
        ..LoadOptions::default()
    };
    let loaded = load_scene(blender.path(), &options).unwrap();
    assert_eq!(loaded.layout, Layout::TransformsJson);
    assert_eq!(loaded.warnings, []);
    assert_eq!(loaded.scene.views.len(), expected.len());
    // `cameras.json` counts pixel centres, so that its principal point is
    // (W − 1)/2. The field of view gives W/2 from the corner of the image: the
    // same rays, half a pixel apart in both.
    assert_eq!(loaded.scene.pixel_center, 0.5);
    for view in &loaded.scene.views {
        let frame = expected[view.name.as_str()];
        let number = |key: &str, i: usize, j: usize| frame[key][i][j].as_f64().unwrap();
        let mut k = Matrix3::from_fn(|i, j| number("K", i, j));
        k[(0, 2)] += loaded.scene.pixel_center;
        k[(1, 2)] += loaded.scene.pixel_center;
        // Relative: the angle was rounded to `f32`, which moves the focal length
        // of 1111 pixels by 2e-5.
        let difference = (view.camera.intrinsics.matrix() - k).amax() / k[(0, 0)];
        assert!(difference < 1e-6, "{}: {difference:e}", view.name);
        let pose = Matrix4::from_fn(|i, j| number("c2w", i, j));
        // The rotations of `cameras.json` were made orthogonal to the last digit.
        let difference = (view.camera.matrix_world_from_camera() - pose).amax();
        assert!(difference < 1e-6, "{}: {difference:e}", view.name);
    }
}

/// Scaled down, so that it is quick, and then written in every format.
#[test]
fn real_scenes_are_written_in_every_format_and_read_back() {
    for name in ["abc-00001776", "dtu-scan24", "strecha-entry-P10"] {
        let Some(dir) = real(name) else {
            continue;
        };
        let options = LoadOptions {
            require_wireframes: false,
            max_image_size: Some(160),
            ..LoadOptions::default()
        };
        let scene = load_scene(&dir, &options).unwrap().scene;
        for format in [
            SceneFormat::Abc,
            SceneFormat::Colmap,
            SceneFormat::CamerasNpz,
            SceneFormat::TransformsJson,
        ] {
            let parent = tempfile::tempdir().unwrap();
            let target = parent.path().join("scene");
            convert(&scene, format, &target).unwrap();
            let back = load_scene(&target, &options).unwrap().scene;
            assert_eq!(back.views.len(), scene.views.len());
            let back_from_world = |point: &Vector3<f64>| {
                let original = scene.original_from_world.apply(point);
                back.original_from_world.inverse().apply(&original)
            };
            for (found, expected) in back.views.iter().zip(&scene.views) {
                assert_eq!(found.name, expected.name);
                assert_eq!(found.image.read().unwrap(), expected.image.read().unwrap());
                let shift = back.pixel_center - scene.pixel_center;
                for pixel in [Vector2::zeros(), Vector2::new(100.0, 70.0)] {
                    let ray = expected.camera.ray_through(&pixel);
                    let point = back_from_world(&(ray.origin + 2.0 * ray.direction));
                    let off = found.camera.project(&point).pixel - pixel.add_scalar(shift);
                    // Poses in the files are orthogonal to seven digits, and traces
                    // of skew are left out.
                    assert!(off.norm() < 0.01, "{name}, {format:?}: {off}");
                }
            }
        }
    }
}

/// `cameras.json` as it is: per file name of the original image K and the pose.
fn json_cameras(dir: &Path) -> BTreeMap<String, (Matrix3<f64>, Matrix4<f64>)> {
    let text = fs::read_to_string(dir.join("cameras.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let frames = json["frames"].as_array().unwrap();
    let camera = |frame: &serde_json::Value| {
        let number = |key: &str, i: usize, j: usize| frame[key][i][j].as_f64().unwrap();
        let name = frame["source_name"].as_str().or(frame["file"].as_str());
        let stem = Path::new(name.unwrap()).file_stem().unwrap();
        let k = Matrix3::from_fn(|i, j| number("K", i, j));
        let pose = Matrix4::from_fn(|i, j| number("c2w", i, j));
        (stem.to_str().unwrap().to_owned(), (k, pose))
    };
    frames.iter().map(camera).collect()
}

/// Largest differences of K and pose over the views of `scene`, relative to the
/// focal length and to the largest coordinate of a centre.
fn differences(
    scene: &Scene,
    cameras: &BTreeMap<String, (Matrix3<f64>, Matrix4<f64>)>,
) -> (f64, f64) {
    let mut largest = (0.0_f64, 0.0_f64);
    for (name, (k, pose)) in cameras {
        let view = scene.views.iter().find(|view| &view.name == name).unwrap();
        let k = (view.camera.intrinsics.matrix() - k).amax() / k[(0, 0)];
        let pose = (view.camera.matrix_world_from_camera() - pose).amax() / pose.amax();
        largest = (largest.0.max(k), largest.1.max(pose));
    }
    largest
}

fn load_as(dir: &Path, layout: Layout) -> Scene {
    let options = LoadOptions {
        layout: Some(layout),
        require_wireframes: false,
        sphere: SphereChoice::File,
        ..LoadOptions::default()
    };
    load_scene(dir, &options).unwrap().scene
}

/// Whether the camera sees the point within its image, give or take two pixels.
fn sees(camera: &Camera, point: &Vector3<f64>) -> bool {
    let seen = camera.project(point);
    let inside = |x: f64, size: u32| (-2.0..=f64::from(size) + 2.0).contains(&x);
    seen.depth > 0.0 && inside(seen.pixel.x, camera.width) && inside(seen.pixel.y, camera.height)
}

/// The scene that OpenMVS gives away, with poses and points as they were written.
#[test]
fn the_castle_agrees_with_the_cameras_and_tracks_made_from_it() {
    let Some(dir) = real("sceaux-castle") else {
        return;
    };
    let castle = tempfile::tempdir().unwrap();
    let images = castle.path().join("images");
    fs::create_dir(&images).unwrap();
    fs::copy(dir.join("scene.mvs"), castle.path().join("scene.mvs")).unwrap();
    for index in 0..10 {
        let name = format!("{index:05}.jpg");
        fs::copy(dir.join("images").join(&name), images.join(&name)).unwrap();
    }
    assert_eq!(Layout::detect(castle.path()).unwrap(), Layout::OpenMvs);
    // The eleventh photograph was not passed on with its pose.
    let options = LoadOptions {
        require_wireframes: false,
        sphere: SphereChoice::File,
        ..LoadOptions::default()
    };
    let loaded = load_scene(castle.path(), &options).unwrap();
    let missing = loaded.warnings[0].to_string();
    assert!(missing.contains("00010.jpg"), "{missing}");
    let scene = loaded.scene;
    assert_eq!((scene.views.len(), scene.pixel_center), (10, 0.0));
    let (k, pose) = differences(&scene, &json_cameras(&dir));
    assert!(k < 1e-12 && pose < 1e-12, "{k:e} {pose:e}");

    let tracks = fs::read_to_string(dir.join("sparse_tracks.json")).unwrap();
    let tracks: serde_json::Value = serde_json::from_str(&tracks).unwrap();
    let (positions, views) = (&tracks["points"], &tracks["views"]);
    assert_eq!(
        scene.sparse_points.len(),
        positions.as_array().unwrap().len()
    );
    let (mut listed, mut seen) = (0, 0);
    for (index, point) in scene.sparse_points.iter().enumerate() {
        let expected = Vector3::from_fn(|axis, _| positions[index][axis].as_f64().unwrap());
        assert!((point.position_in_world - expected).amax() < 1e-6);
        let mut expected: Vec<_> = views[index].as_array().unwrap().iter().collect();
        expected.retain(|view| **view != 10);
        let found = point.observations.iter().map(|seen| seen.view as u64);
        // All but those that a point far off puts behind a camera.
        assert!(
            found
                .clone()
                .all(|view| expected.iter().any(|other| **other == view))
        );
        listed += expected.len();
        let visible = |view: &&usize| sees(&scene.views[**view].camera, &point.position_in_world);
        let found: Vec<_> = found.map(|view| view as usize).collect();
        seen += found.iter().filter(visible).count();
    }
    // Structure from motion leaves a few points far off.
    let share = seen as f64 / listed as f64;
    assert!(share > 0.995, "{share}");
}

#[test]
fn strechas_cameras_agree_with_the_cameras_made_from_them() {
    let Some(dir) = real("strecha-entry-P10") else {
        return;
    };
    let scene = load_as(&dir, Layout::Strecha);
    assert_eq!(scene.views.len(), 10);
    let (k, pose) = differences(&scene, &json_cameras(&dir));
    assert!(k < 1e-12 && pose < 1e-12, "{k:e} {pose:e}");
    for point in read_points(&dir.join("sparse_points.ply")).unwrap() {
        let seen = scene.views.iter().filter(|view| sees(&view.camera, &point));
        assert!(
            seen.count() >= 3,
            "points were triangulated from three views or more"
        );
    }
}

#[test]
fn sparse_points_of_dtu_are_seen() {
    let Some(dir) = real("dtu-scan24") else {
        return;
    };
    let scene = load_as(&dir, Layout::Dtu);
    for point in read_points(&dir.join("sparse_points.ply")).unwrap() {
        let seen = scene.views.iter().filter(|view| sees(&view.camera, &point));
        assert!(seen.count() >= 3);
    }
}

#[test]
fn the_meta_data_of_emap_agree_with_the_cameras_made_from_them() {
    let Some(dir) = real("abcnef-00004926") else {
        return;
    };
    // The images have got other names since; those of EMAP are made again.
    let text = fs::read_to_string(dir.join("cameras.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let emap = tempfile::tempdir().unwrap();
    fs::copy(
        dir.join("meta_data.json"),
        emap.path().join("meta_data.json"),
    )
    .unwrap();
    for frame in json["frames"].as_array().unwrap() {
        let [from, to] = ["file", "source_name"].map(|key| frame[key].as_str().unwrap());
        fs::copy(dir.join(from), emap.path().join(to)).unwrap();
    }
    // One image was not passed on with its pose.
    let missing = emap.path().join("21_colors.png");
    RgbImage::new(800, 800).save(missing).unwrap();
    assert_eq!(Layout::detect(emap.path()).unwrap(), Layout::MetaDataJson);
    let scene = load_as(emap.path(), Layout::MetaDataJson);
    assert_eq!((scene.views.len(), scene.pixel_center), (50, 0.0));
    // The rotations of `cameras.json` were made orthogonal to the last digit.
    let (k, pose) = differences(&scene, &json_cameras(&dir));
    assert!(k < 1e-12 && pose < 1e-6, "{k:e} {pose:e}");
}

/// The offset across a projected edge, in pixels, at which the image changes most,
/// or `None` where it hardly changes: the edge is hidden, or leaves the image.
fn offset_of_edge(view: &View, middle: &Vector2<f64>, normal: &Vector2<f64>) -> Option<f64> {
    const REACH: i32 = 12;
    const STEP: f64 = 0.25;
    let image = view.image.read().unwrap();
    let brightness = |at: Vector2<f64>| {
        // Between the centres of four pixels.
        let at = at.add_scalar(-0.5);
        let (x, y) = (at.x.floor(), at.y.floor());
        let (dx, dy) = (at.x - x, at.y - y);
        let pixel = |x: f64, y: f64| {
            let inside = x >= 0.0 && y >= 0.0;
            let pixel = image
                .get_pixel_checked(x as u32, y as u32)
                .filter(|_| inside)?;
            Some(pixel.0.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0)
        };
        let top = pixel(x, y)? * (1.0 - dx) + pixel(x + 1.0, y)? * dx;
        let bottom = pixel(x, y + 1.0)? * (1.0 - dx) + pixel(x + 1.0, y + 1.0)? * dx;
        Some(top * (1.0 - dy) + bottom * dy)
    };
    let mut strongest = (0.0, 0.0);
    for step in -REACH..=REACH {
        let offset = f64::from(step) * STEP;
        let at = middle + normal * offset;
        let change = (brightness(at + normal * 0.5)? - brightness(at - normal * 0.5)?).abs();
        if change > strongest.0 {
            strongest = (change, offset);
        }
    }
    (strongest.0 > 15.0).then_some(strongest.1)
}

/// Edges of the truth lie on edges of the images: poses, intrinsics and pixel
/// centres all agree. Half a pixel of a wrong pixel centre would be seen.
#[test]
fn true_edges_lie_on_edges_of_the_images() {
    for name in [
        "abc-00075213",
        "abc-00001776",
        "abc-00003173",
        "cad-0406",
        "cad-three-concave",
        "abcnef-00000952",
        "abcnef-00004926",
    ] {
        let Some(dir) = real(name) else {
            continue;
        };
        let scene = load_as(&dir, Layout::CamerasJson);
        let truth = read_wireframe(&dir.join("gt_wireframe.json")).unwrap();
        // Along the axes of the image, signed: to the right and down.
        let mut offsets = [Vec::new(), Vec::new()];
        for view in scene.views.iter().step_by(5) {
            for segment in truth.segments() {
                let [a, b] = segment.ends().map(|end| view.camera.project(&end).pixel);
                // To where the corner of the image is the origin.
                let [a, b] = [a, b].map(|end| end.add_scalar(0.5 - scene.pixel_center));
                let along = b - a;
                if along.norm() < 20.0 {
                    continue;
                }
                let axis = usize::from(along.x.abs() > along.y.abs());
                let mut normal = Vector2::new(-along.y, along.x) / along.norm();
                normal *= normal[axis].signum();
                let samples = (1..10).map(|i| a + along * (f64::from(i) / 10.0));
                offsets[axis].extend(samples.filter_map(|at| offset_of_edge(view, &at, &normal)));
            }
        }
        for offsets in &mut offsets {
            assert!(offsets.len() > 100, "{name}: {}", offsets.len());
            offsets.sort_by(f64::total_cmp);
            let median = offsets[offsets.len() / 2];
            assert!(median.abs() <= 0.25, "{name}: {median}");
        }
    }
}

#[test]
fn ground_truth_counts_are_those_of_the_data_readme() {
    let truths = [
        ("abc-00001776", 20, 30, 0),
        ("abc-00003173", 15, 23, 0),
        ("cad-0406", 27, 41, 0),
        ("cad-three-concave", 16, 20, 2),
        ("abcnef-00000952", 20, 30, 0),
        ("abcnef-00004926", 20, 27, 6),
    ];
    for (name, junctions, lines, curves) in truths {
        let Some(dir) = real(name) else {
            continue;
        };
        let truth = read_ground_truth(&dir.join("gt_wireframe.json")).unwrap();
        let counts = (
            truth.wireframe.junctions.len(),
            truth.wireframe.edges.len(),
            truth.curves.len(),
        );
        assert_eq!(counts, (junctions, lines, curves), "{name}");
        let wireframe = read_wireframe(&dir.join("gt_wireframe.json")).unwrap();
        assert_eq!(wireframe, truth.wireframe);
    }
}

#[test]
fn point_clouds_of_both_encodings_are_read() {
    let clouds = [
        ("dtu-scan24", "sparse_points.ply", 5804),
        ("strecha-entry-P10", "sparse_points.ply", 3104),
        ("sceaux-castle", "scene_mesh_refine.ply", 87685),
    ];
    for (name, file, points) in clouds {
        let Some(dir) = real(name) else {
            continue;
        };
        assert_eq!(
            read_points(&dir.join(file)).unwrap().len(),
            points,
            "{name}"
        );
    }
}

/// The sphere of every scene holds what is known of it, and little more.
#[test]
fn spheres_hold_their_scenes() {
    use SphereSource::{Cameras, File, Masks, Points};
    let scenes = [
        ("abc-00001776", File),
        ("abc-00003173", File),
        ("cad-0406", File),
        ("cad-three-concave", File),
        // Transparent images; the origin is a corner of the object's cube.
        ("abcnef-00000952", Masks),
        ("abcnef-00004926", Masks),
        ("dtu-scan24", File),
        ("strecha-entry-P10", Points),
        ("sceaux-castle", Points),
    ];
    for (name, source) in scenes {
        let Some(dir) = real(name) else {
            continue;
        };
        for choice in [SphereChoice::Auto, SphereChoice::Cameras] {
            let options = LoadOptions {
                layout: Some(Layout::CamerasJson),
                require_wireframes: false,
                sphere: choice,
                ..LoadOptions::default()
            };
            let loaded = load_scene(&dir, &options).unwrap();
            if choice == SphereChoice::Cameras {
                assert_eq!(loaded.sphere.source, Cameras);
                continue;
            }
            assert_eq!(loaded.sphere.source, source, "{name}");
            let truth = dir.join("gt_wireframe.json");
            let scene = &loaded.scene;
            let world_from_original = scene.original_from_world.inverse();
            let mut shares: Vec<f64> = match truth.exists() {
                true => (read_ground_truth(&truth)
                    .unwrap()
                    .wireframe
                    .junctions
                    .iter())
                .map(|point| world_from_original.apply(point).norm())
                .collect(),
                false => (scene.sparse_points.iter())
                    .map(|point| point.position_in_world.norm())
                    .collect(),
            };
            shares.iter_mut().for_each(|x| *x /= scene.sphere_radius);
            shares.sort_by(f64::total_cmp);
            let [most, half] =
                [0.97, 0.5].map(|q| shares[(q * (shares.len() - 1) as f64) as usize]);
            assert!(most <= 1.0 && half > 0.2, "{name}: {half} {most}");
        }
    }
}
