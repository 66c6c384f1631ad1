//! One scene written in the formats of structure from motion: whichever is read,
//! the cameras see the points at the same places of the photographs.

use image::RgbImage;
use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion, Vector2, Vector3};
use neat_core::layout::Layout;
use neat_core::{
    Camera, Intrinsics, LoadOptions, Scene, SceneError, Similarity, SphereChoice, load_scene,
};
use serde_json::json;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const WIDTH: u32 = 12;
const HEIGHT: u32 = 8;
const FOCAL_LENGTH: f64 = 20.0;
/// In the order of the files, which is not that of the names.
const NAMES: [&str; 2] = ["b", "a"];
/// Seen by both cameras; numbers that `f32` can hold.
const POINTS: [[f64; 3]; 2] = [[0.25, -0.5, 0.125], [-0.75, 0.25, 0.5]];

/// The cameras of [`NAMES`], in image coordinates whose origin is the corner.
fn cameras() -> [Camera; 2] {
    let camera = |angle: f64, center| {
        let axis = nalgebra::Unit::new_normalize(Vector3::new(0.3, 1.0, -0.2));
        Camera {
            intrinsics: Intrinsics::centered(FOCAL_LENGTH, (WIDTH, HEIGHT)),
            world_from_camera: Rotation3::from_axis_angle(&axis, angle).into_inner(),
            center_in_world: center,
            width: WIDTH,
            height: HEIGHT,
        }
    };
    [
        camera(0.2, Vector3::new(-1.0, 0.25, -8.0)),
        camera(-0.3, Vector3::new(2.5, 0.5, -7.0)),
    ]
}

/// Where camera `index` sees a point.
fn pixel(index: usize, point: [f64; 3]) -> Vector2<f64> {
    cameras()[index].project(&Vector3::from(point)).pixel
}

/// The rotation camera-from-world.
fn rotation(camera: &Camera) -> Matrix3<f64> {
    camera.world_from_camera.transpose()
}

fn rows<const N: usize>(matrix: &nalgebra::SMatrix<f64, N, N>) -> Vec<Vec<f64>> {
    let rows = matrix.row_iter();
    rows.map(|row| row.iter().copied().collect()).collect()
}

/// Numbers with a space before each.
fn numbers(numbers: impl IntoIterator<Item = f64>) -> String {
    let mut text = String::new();
    for number in numbers {
        write!(text, " {number}").unwrap();
    }
    text
}

/// The elements row by row.
fn row_major(matrix: &Matrix3<f64>) -> Vec<f64> {
    rows(matrix).concat()
}

fn images_dir() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("images")).unwrap();
    for name in NAMES {
        let path = dir.path().join(format!("images/{name}.png"));
        RgbImage::new(WIDTH, HEIGHT).save(path).unwrap();
    }
    dir
}

fn write_nvm(dir: &Path) {
    let mut text = "NVM_V3\n\n2\n".to_owned();
    for (name, camera) in NAMES.iter().zip(cameras()) {
        let rotation = Rotation3::from_matrix_unchecked(rotation(&camera));
        let q = UnitQuaternion::from_rotation_matrix(&rotation);
        let pose = [q.w, q.i, q.j, q.k]
            .into_iter()
            .chain(camera.center_in_world.iter().copied());
        writeln!(text, "{name}.png\t{FOCAL_LENGTH}{} 0 0", numbers(pose)).unwrap();
    }
    text += "\n2\n";
    for point in POINTS {
        write!(text, "{} 1 2 3 2", &numbers(point)[1..]).unwrap();
        for index in 0..2 {
            let middle = Vector2::new(f64::from(WIDTH), f64::from(HEIGHT)) / 2.0;
            let measured = pixel(index, point) - middle;
            write!(text, " {index} 0{}", numbers(measured.iter().copied())).unwrap();
        }
        text += "\n";
    }
    text += "\n0\n";
    fs::write(dir.join("model.nvm"), text).unwrap();
}

fn write_bundler(dir: &Path) {
    let mut text = "# Bundle file v0.3\n2 2\n".to_owned();
    for camera in cameras() {
        let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
        let rotation = flip * rotation(&camera);
        let translation = -(rotation * camera.center_in_world);
        writeln!(text, "{FOCAL_LENGTH} 0 0").unwrap();
        for row in rows(&rotation) {
            writeln!(text, "{}", numbers(row)).unwrap();
        }
        writeln!(text, "{}", numbers(translation.iter().copied())).unwrap();
    }
    for point in POINTS {
        write!(text, "{}\n1 2 3\n2", numbers(point)).unwrap();
        for index in 0..2 {
            let seen = pixel(index, point);
            let (x, y) = (
                seen.x - f64::from(WIDTH) / 2.0,
                f64::from(HEIGHT) / 2.0 - seen.y,
            );
            write!(text, " {index} 0 {x} {y}").unwrap();
        }
        text += "\n";
    }
    fs::create_dir(dir.join("bundle")).unwrap();
    fs::write(dir.join("bundle/bundle.out"), text).unwrap();
    fs::write(
        dir.join("list.txt"),
        "images/b.jpg 0 20.5\n./images/a.png\n",
    )
    .unwrap();
}

/// K in coordinates that count pixel centres.
fn integer_k(camera: &Camera) -> Matrix3<f64> {
    let mut k = camera.intrinsics.matrix();
    k[(0, 2)] -= 0.5;
    k[(1, 2)] -= 0.5;
    k
}

fn write_openmvg(dir: &Path) {
    let pointer = |id: u32, data| json!({"polymorphic_id": 1073741824, "ptr_wrapper": {"id": id, "data": data}});
    let entries = |make: &dyn Fn(usize) -> serde_json::Value| -> Vec<_> {
        (0..2)
            .map(|key| json!({"key": key, "value": make(key)}))
            .collect()
    };
    let k = integer_k(&cameras()[0]);
    let json = json!({
        "sfm_data_version": "0.3",
        "root_path": "/home/someone/photos",
        "views": entries(&|key| pointer(2147483649 + key as u32, json!({
            "local_path": "", "filename": format!("{}.jpg", NAMES[key]), "width": WIDTH,
            "height": HEIGHT, "id_view": key, "id_intrinsic": 0, "id_pose": key}))),
        "intrinsics": [{"key": 0, "value": {"polymorphic_id": 2147483649_u32,
            "polymorphic_name": "pinhole", "ptr_wrapper": {"id": 2147483660_u32, "data": {
            "width": WIDTH, "height": HEIGHT, "focal_length": FOCAL_LENGTH,
            "principal_point": [k[(0, 2)], k[(1, 2)]]}}}}],
        "extrinsics": entries(&|key| json!({"rotation": rows(&rotation(&cameras()[key])),
            "center": cameras()[key].center_in_world.as_slice()})),
        "structure": entries(&|key| json!({"X": POINTS[key], "observations":
            entries(&|view| json!({"id_feat": 0,
                "x": pixel(view, POINTS[key]).add_scalar(-0.5).as_slice()}))})),
        "control_points": [],
    });
    let dir = dir.join("reconstruction_sequential");
    fs::create_dir(&dir).unwrap();
    fs::write(dir.join("sfm_data.json"), json.to_string()).unwrap();
}

fn write_openmvs(dir: &Path) {
    let mut bytes = b"MVSI".to_vec();
    let count = |bytes: &mut Vec<u8>, count: usize| bytes.extend((count as u64).to_le_bytes());
    let ints =
        |bytes: &mut Vec<u8>, ints: &[u32]| bytes.extend(ints.iter().flat_map(|x| x.to_le_bytes()));
    let doubles = |bytes: &mut Vec<u8>, numbers: &[f64]| {
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    };
    ints(&mut bytes, &[1, 0]);
    count(&mut bytes, 1);
    count(&mut bytes, 0); // an empty name
    count(&mut bytes, 1);
    count(&mut bytes, 0);
    ints(&mut bytes, &[0, 0]); // normalised
    let larger = f64::from(WIDTH.max(HEIGHT));
    let scale = Matrix3::from_diagonal(&Vector3::new(1.0 / larger, 1.0 / larger, 1.0));
    doubles(&mut bytes, &row_major(&(scale * integer_k(&cameras()[0]))));
    doubles(&mut bytes, &row_major(&Matrix3::identity()));
    doubles(&mut bytes, &[0.0; 3]);
    count(&mut bytes, 2);
    for camera in cameras() {
        doubles(&mut bytes, &row_major(&rotation(&camera)));
        doubles(&mut bytes, camera.center_in_world.as_slice());
    }
    count(&mut bytes, 2);
    for (index, name) in (0..).zip(NAMES) {
        let path = format!(r"D:\work\images\{name}.png");
        count(&mut bytes, path.len());
        bytes.extend(path.as_bytes());
        ints(&mut bytes, &[0, 0, index]);
    }
    count(&mut bytes, 2);
    for point in POINTS {
        bytes.extend(point.iter().flat_map(|x| (*x as f32).to_le_bytes()));
        count(&mut bytes, 2);
        ints(&mut bytes, &[0, 0, 1, 0]);
    }
    fs::write(dir.join("scene.mvs"), bytes).unwrap();
}

fn write_meta_data(dir: &Path) {
    let frames: Vec<_> = NAMES
        .iter()
        .zip(cameras())
        .map(|(name, camera)| {
            json!({"rgb_path": format!("{name}.png"), "intrinsics": rows(&integer_k(&camera)),
                "camtoworld": rows(&camera.matrix_world_from_camera())})
        })
        .collect();
    let world_to_gt: Matrix4<f64> = Matrix4::identity();
    let json = json!({"camera_model": "OPENCV", "width": WIDTH, "height": HEIGHT,
        "worldtogt": rows(&world_to_gt), "frames": frames});
    fs::write(dir.join("meta_data.json"), json.to_string()).unwrap();
}

fn write_strecha(dir: &Path) {
    fs::create_dir(dir.join("gt_dense_cameras")).unwrap();
    for (name, camera) in NAMES.iter().zip(cameras()) {
        let mut text = String::new();
        for row in rows(&camera.intrinsics.matrix()) {
            writeln!(text, "{}", numbers(row)).unwrap();
        }
        text += "0 0 0\n";
        for row in rows(&camera.world_from_camera) {
            writeln!(text, "{}", numbers(row)).unwrap();
        }
        let center = numbers(camera.center_in_world.iter().copied());
        writeln!(text, "{center}\n{WIDTH} {HEIGHT}").unwrap();
        fs::write(
            dir.join(format!("gt_dense_cameras/{name}.jpg.camera")),
            text,
        )
        .unwrap();
    }
}

/// A format with the places where its tools put their files.
struct Format {
    layout: Layout,
    write: fn(&Path),
    pixel_center: f64,
    has_points: bool,
}

const FORMATS: [Format; 6] = [
    Format {
        layout: Layout::MetaDataJson,
        write: write_meta_data,
        pixel_center: 0.0,
        has_points: false,
    },
    Format {
        layout: Layout::OpenMvg,
        write: write_openmvg,
        pixel_center: 0.0,
        has_points: true,
    },
    Format {
        layout: Layout::OpenMvs,
        write: write_openmvs,
        pixel_center: 0.0,
        has_points: true,
    },
    Format {
        layout: Layout::VisualSfm,
        write: write_nvm,
        pixel_center: 0.5,
        has_points: true,
    },
    Format {
        layout: Layout::Bundler,
        write: write_bundler,
        pixel_center: 0.5,
        has_points: true,
    },
    Format {
        layout: Layout::Strecha,
        write: write_strecha,
        pixel_center: 0.5,
        has_points: false,
    },
];

fn options() -> LoadOptions {
    LoadOptions {
        require_wireframes: false,
        sphere: SphereChoice::File,
        ..LoadOptions::default()
    }
}

fn assert_is_the_scene(scene: &Scene, format: &Format) {
    let layout = format.layout;
    assert_eq!(scene.original_from_world, Similarity::identity());
    assert_eq!(scene.pixel_center, format.pixel_center, "{layout}");
    let names: Vec<_> = scene.views.iter().map(|view| view.name.as_str()).collect();
    assert_eq!(names, ["a", "b"], "{layout}");
    // The names are in the other order than the files.
    for (view, expected) in scene.views.iter().zip(cameras().into_iter().rev()) {
        let pose = view.camera.matrix_world_from_camera() - expected.matrix_world_from_camera();
        assert!(pose.amax() < 1e-12, "{layout}: {pose}");
        // Half a pixel less where pixel centres are counted.
        let mut k = expected.intrinsics.matrix();
        k[(0, 2)] += format.pixel_center - 0.5;
        k[(1, 2)] += format.pixel_center - 0.5;
        let k = view.camera.intrinsics.matrix() - k;
        assert!(k.amax() < 1e-12, "{layout}: {k}");
    }
    if !format.has_points {
        assert_eq!(scene.sparse_points, [], "{layout}");
        return;
    }
    assert_eq!(scene.sparse_points.len(), POINTS.len(), "{layout}");
    for (point, expected) in scene.sparse_points.iter().zip(POINTS) {
        assert_eq!(point.position_in_world, Vector3::from(expected), "{layout}");
        let seen: Vec<_> = point.observations.iter().map(|seen| seen.view).collect();
        assert_eq!(seen, [1, 0], "{layout}");
        for seen in &point.observations {
            let camera = &scene.views[seen.view].camera;
            let error = camera.project(&point.position_in_world).pixel - seen.pixel;
            assert!(error.amax() < 1e-9, "{layout}: {error}");
        }
    }
}

#[test]
fn every_format_gives_the_same_scene() {
    for format in &FORMATS {
        let dir = images_dir();
        (format.write)(dir.path());
        let loaded = load_scene(dir.path(), &options()).unwrap();
        assert_eq!(loaded.layout, format.layout);
        assert_eq!(loaded.warnings, [], "{}", format.layout);
        assert_is_the_scene(&loaded.scene, format);
    }
}

#[test]
fn layouts_are_told_in_the_documented_order() {
    let dir = images_dir();
    // The last first: every further file is preferred to those before.
    for format in FORMATS.iter().rev() {
        (format.write)(dir.path());
        assert_eq!(Layout::detect(dir.path()).unwrap(), format.layout);
    }
    // Whichever is asked for is read.
    for format in &FORMATS {
        let options = LoadOptions {
            layout: Some(format.layout),
            ..options()
        };
        let scene = load_scene(dir.path(), &options).unwrap().scene;
        assert_is_the_scene(&scene, format);
    }
}

#[test]
fn missing_files_are_named() {
    let dir = images_dir();
    for format in &FORMATS {
        let options = LoadOptions {
            layout: Some(format.layout),
            ..options()
        };
        let error = load_scene(dir.path(), &options).unwrap_err();
        assert!(matches!(error, SceneError::Missing { .. }), "{error}");

        let dir = images_dir();
        (format.write)(dir.path());
        let all = load_scene(dir.path(), &options).unwrap().scene;
        fs::remove_file(dir.path().join("images/a.png")).unwrap();
        let loaded = load_scene(dir.path(), &options).unwrap();
        let warning = loaded.warnings[0].to_string();
        assert!(warning.contains("/a."), "{:?}: {warning}", format.layout);
        assert_eq!(loaded.scene.views.len(), all.views.len() - 1);
        // Observations of the views that are left still meet their points.
        for point in &loaded.scene.sparse_points {
            for seen in &point.observations {
                let camera = &loaded.scene.views[seen.view].camera;
                let projected = camera.project(&point.position_in_world).pixel;
                assert!((projected - seen.pixel).norm() < 1.0, "{:?}", format.layout);
            }
        }
        for view in &all.views[1..] {
            fs::remove_file(dir.path().join(format!("images/{}.png", view.name))).unwrap();
        }
        let error = load_scene(dir.path(), &options).unwrap_err();
        assert!(matches!(error, SceneError::Missing { .. }), "{error}");
    }
    write_bundler(dir.path());
    fs::remove_file(dir.path().join("list.txt")).unwrap();
    let message = load_scene(dir.path(), &options()).unwrap_err().to_string();
    assert!(message.contains("list.txt"), "{message}");
}
