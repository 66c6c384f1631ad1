//! COLMAP models: the pose convention, both forms of the files, and the errors of
//! bad ones.

use image::{Rgb, RgbImage};
use nalgebra::{Vector2, Vector3};
use neat_core::layout::{Layout, SceneWarning};
use neat_core::{
    LoadOptions, LoadedScene, Observation, Scene, SceneError, Similarity, SphereChoice,
    Wireframe2d, hawp_json, load_scene,
};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const WIDTH: u32 = 12;
const HEIGHT: u32 = 8;

const CAMERAS: &str = "\
# Camera list with one line of data per camera:
7 PINHOLE 12 8 20 21 6.5 4
2 SIMPLE_RADIAL 12 8 20 6 4 0
";
/// In another order than that of the names. The second image is turned by 90°
/// about z; its quaternion is not of unit length.
const IMAGES: &str = "\
# Image list with two lines of data per image:
3 2 0 0 2 1 2 3 7 right/view_1.png
1.5 2.5 -1 3.5 4.5 9
1 1 0 0 0 0.5 -0.25 4 2 view_0.png

";
const POINTS: &str = "\
1 10 20 30 255 0 128 0.5 1 0 3 1
4 9 21 31 1 2 3 0.5
2 5000 -9000 29 1 2 3 0.5 3 0
";

/// Images and wireframes of the model.
fn scene_dir() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir_all(dir.path().join("images/right")).unwrap();
    fs::create_dir_all(dir.path().join("hawp")).unwrap();
    for (index, name) in ["view_0", "right/view_1"].into_iter().enumerate() {
        let image = RgbImage::from_pixel(WIDTH, HEIGHT, Rgb([index as u8; 3]));
        let path = dir.path().join("images").join(name);
        image.save(path.with_extension("png")).unwrap();
        let wireframe = Wireframe2d {
            vertices: vec![Vector2::new(1.5, 2.25), Vector2::new(7.0, 3.0)],
            vertex_scores: vec![0.5, 0.75],
            edges: vec![[0, 1]],
            edge_scores: vec![0.9],
            width: WIDTH,
            height: HEIGHT,
        };
        let path = dir.path().join(format!("hawp/view_{index}.json"));
        hawp_json::write(&path, &wireframe, 0.5).unwrap();
    }
    dir
}

fn write(dir: &Path, files: [(&str, &[u8]); 3]) {
    fs::create_dir_all(dir).unwrap();
    for (name, bytes) in files {
        fs::write(dir.join(name), bytes).unwrap();
    }
}

fn write_text(dir: &Path, cameras: &str, images: &str, points: &str) {
    let files = [
        ("cameras.txt", cameras.as_bytes()),
        ("images.txt", images.as_bytes()),
        ("points3D.txt", points.as_bytes()),
    ];
    write(dir, files);
}

/// The scene with the model as text in `sparse/0`.
fn text_scene(cameras: &str, images: &str, points: &str) -> TempDir {
    let dir = scene_dir();
    write_text(&dir.path().join("sparse/0"), cameras, images, points);
    dir
}

/// Little-endian bytes.
trait Put {
    fn ints<const N: usize>(&mut self, numbers: [u32; N]) -> &mut Self;
    fn longs<const N: usize>(&mut self, numbers: [u64; N]) -> &mut Self;
    fn doubles<const N: usize>(&mut self, numbers: [f64; N]) -> &mut Self;
    fn raw(&mut self, bytes: &[u8]) -> &mut Self;
}

impl Put for Vec<u8> {
    fn ints<const N: usize>(&mut self, numbers: [u32; N]) -> &mut Self {
        self.raw(&numbers.map(u32::to_le_bytes).concat())
    }
    fn longs<const N: usize>(&mut self, numbers: [u64; N]) -> &mut Self {
        self.raw(&numbers.map(u64::to_le_bytes).concat())
    }
    fn doubles<const N: usize>(&mut self, numbers: [f64; N]) -> &mut Self {
        self.raw(&numbers.map(f64::to_le_bytes).concat())
    }
    fn raw(&mut self, bytes: &[u8]) -> &mut Self {
        self.extend(bytes);
        self
    }
}

/// [`CAMERAS`], [`IMAGES`] and [`POINTS`] as binary files.
fn binary_files() -> [Vec<u8>; 3] {
    let [mut cameras, mut images, mut points] = [const { Vec::new() }; 3];
    cameras.longs([2]);
    cameras.ints([7, 1]).longs([12, 8]);
    cameras.doubles([20.0, 21.0, 6.5, 4.0]);
    cameras.ints([2, 2]).longs([12, 8]);
    cameras.doubles([20.0, 6.0, 4.0, 0.0]);

    images.longs([2]);
    images.ints([3]);
    images.doubles([2.0, 0.0, 0.0, 2.0, 1.0, 2.0, 3.0]);
    images.ints([7]).raw(b"right/view_1.png\0").longs([2]);
    images.doubles([1.5, 2.5]).longs([u64::MAX]);
    images.doubles([3.5, 4.5]).longs([9]);
    images.ints([1]);
    images.doubles([1.0, 0.0, 0.0, 0.0, 0.5, -0.25, 4.0]);
    images.ints([2]).raw(b"view_0.png\0").longs([0]);

    points.longs([3]);
    let track = [[1u32, 0, 3, 1].as_slice(), &[], &[3, 0]];
    let xyz = [[10.0, 20.0, 30.0], [9.0, 21.0, 31.0], [5e3, -9e3, 29.0]];
    for ((id, xyz), track) in [1, 4, 2].into_iter().zip(xyz).zip(track) {
        points.longs([id]).doubles(xyz).raw(&[1, 2, 3]);
        points.doubles([0.5]).longs([track.len() as u64 / 2]);
        track.iter().for_each(|&number| {
            points.ints([number]);
        });
    }
    [cameras, images, points]
}

fn write_binary(dir: &Path, [cameras, images, points]: &[Vec<u8>; 3]) {
    let files = [
        ("cameras.bin", cameras.as_slice()),
        ("images.bin", images),
        ("points3D.bin", points),
    ];
    write(dir, files);
}

fn load(dir: &TempDir) -> Result<LoadedScene, SceneError> {
    // The sphere has its own tests: here the frame of the files counts.
    let options = LoadOptions {
        sphere: SphereChoice::File,
        ..LoadOptions::default()
    };
    load_scene(dir.path(), &options)
}

fn assert_same(a: &Scene, b: &Scene) {
    assert_eq!(a.original_from_world, b.original_from_world);
    assert_eq!(a.sparse_points, b.sparse_points);
    assert_eq!(a.views.len(), b.views.len());
    for (a, b) in a.views.iter().zip(&b.views) {
        assert_eq!((&a.name, &a.camera), (&b.name, &b.camera));
        assert_eq!(a.wireframe, b.wireframe);
        assert_eq!(a.image.read().unwrap(), b.image.read().unwrap());
    }
}

#[test]
fn points_appear_where_the_formulas_of_colmap_put_them() {
    let loaded = load(&text_scene(CAMERAS, IMAGES, POINTS)).unwrap();
    let scene = loaded.scene;
    assert_eq!(loaded.layout, Layout::Colmap);
    assert_eq!(loaded.warnings, []);
    assert_eq!(scene.pixel_center, 0.5);
    assert_eq!(scene.original_from_world, Similarity::identity());
    scene.validate().unwrap();
    let [first, second] = scene.views.as_slice() else {
        panic!("two views");
    };
    assert_eq!([&first.name, &second.name], ["view_0", "view_1"]);
    assert_eq!(second.image.pixel(0, 0).unwrap(), Rgb([1; 3]));

    let in_world = Vector3::new(2.0, 3.0, 5.0);
    // No rotation: the point is (2.5, 2.75, 9) in the camera.
    let found = first.camera.project(&in_world);
    let expected = Vector2::new(20.0 * 2.5 / 9.0 + 6.0, 20.0 * 2.75 / 9.0 + 4.0);
    assert!((found.pixel - expected).amax() < 1e-9, "{found:?}");
    assert!((found.depth - 9.0).abs() < 1e-9);
    // 90° about z takes (2, 3, 5) to (−3, 2, 5), the translation to (−2, 4, 8).
    let found = second.camera.project(&in_world);
    let expected = Vector2::new(20.0 * -2.0 / 8.0 + 6.5, 21.0 * 4.0 / 8.0 + 4.0);
    assert!((found.pixel - expected).amax() < 1e-9, "{found:?}");
    assert!((found.depth - 8.0).abs() < 1e-9);

    let points = &scene.sparse_points;
    let positions: Vec<_> = points.iter().map(|p| p.position_in_world.y).collect();
    assert_eq!(positions, [20.0, 21.0, -9000.0]);
    let seen: Vec<_> = points.iter().map(|p| p.observations.as_slice()).collect();
    let by_second = |x, y| Observation {
        view: 1,
        pixel: Vector2::new(x, y),
    };
    let expected: [&[_]; 3] = [&[by_second(3.5, 4.5)], &[], &[by_second(1.5, 2.5)]];
    assert_eq!(seen, expected);
}

#[test]
fn text_and_binary_are_the_same_wherever_they_lie() {
    let expected = load(&text_scene(CAMERAS, IMAGES, POINTS)).unwrap().scene;
    for below in ["sparse/0", "sparse", "", "colmap/sparse/0"] {
        let text = scene_dir();
        write_text(&text.path().join(below), CAMERAS, IMAGES, POINTS);
        let binary = scene_dir();
        write_binary(&binary.path().join(below), &binary_files());
        // What recent versions add.
        fs::write(binary.path().join(below).join("rigs.bin"), b"x").unwrap();
        for dir in [text, binary] {
            assert_eq!(Layout::detect(dir.path()).unwrap(), Layout::Colmap);
            assert_same(&load(&dir).unwrap().scene, &expected);
        }
    }
    // What the undistorter writes lies together.
    for below in ["dense", "dense/0"] {
        let dir = scene_dir();
        let dense = dir.path().join(below);
        write_text(&dense.join("sparse"), CAMERAS, IMAGES, POINTS);
        fs::rename(dir.path().join("images"), dense.join("images")).unwrap();
        assert_same(&load(&dir).unwrap().scene, &expected);
    }
}

#[test]
fn files_are_preferred_in_a_fixed_order() {
    let dir = text_scene(CAMERAS, IMAGES, POINTS);
    // Would be errors if they were read.
    write_text(dir.path(), "x", "x", "x");
    write_text(&dir.path().join("sparse"), "x", "x", "x");
    load(&dir).unwrap();
    let sparse = dir.path().join("sparse/0");
    write_text(&sparse, "x", "x", "x");
    write_binary(&sparse, &binary_files());
    load(&dir).unwrap();

    fs::write(dir.path().join("cameras.json"), "{}").unwrap();
    assert_eq!(Layout::detect(dir.path()).unwrap(), Layout::CamerasJson);
    fs::remove_file(dir.path().join("cameras.json")).unwrap();
    // Half of a text model beside half of a binary one is none.
    let dir = scene_dir();
    fs::write(dir.path().join("cameras.txt"), CAMERAS).unwrap();
    fs::write(dir.path().join("images.bin"), &binary_files()[1]).unwrap();
    assert!(matches!(load(&dir), Err(SceneError::UnknownLayout { .. })));
    let options = LoadOptions {
        layout: Some(Layout::Colmap),
        ..LoadOptions::default()
    };
    let missing = load_scene(dir.path(), &options).unwrap_err();
    assert!(matches!(missing, SceneError::Missing { .. }));
}

#[test]
fn long_lists_of_images_that_are_not_there_are_refused_at_once() {
    let dir = scene_dir();
    let mut images = String::new();
    for image in 0..300_000 {
        images += &format!("{image} 1 0 0 0 0 0 0 7 image-{image}.png\n\n");
    }
    write_text(dir.path(), CAMERAS, &images, "");
    let error = load(&dir).unwrap_err().to_string();
    assert!(error.contains("image-0.png does not exist"), "{error}");
}

#[test]
fn images_without_a_pose_are_told() {
    let dir = text_scene(CAMERAS, IMAGES, POINTS);
    assert_eq!(load(&dir).unwrap().warnings, []);
    // A copy in another format, and two images that the model has lost.
    for name in ["view_0.jpg", "view_7.png", "right/view_8.png"] {
        let path = dir.path().join("images").join(name);
        RgbImage::new(WIDTH, HEIGHT).save(path).unwrap();
    }
    let warnings = load(&dir).unwrap().warnings;
    let told = SceneWarning::ImagesWithoutPose {
        first: dir.path().join("images/view_7.png"),
        images: 2,
    };
    assert_eq!(warnings, [told]);
}

#[test]
fn points_may_be_missing() {
    let dir = text_scene(CAMERAS, IMAGES, "");
    let empty = load(&dir).unwrap().scene;
    assert_eq!(empty.sparse_points, []);
    let center = empty.views[0].camera.center_in_world;
    assert_eq!(center, Vector3::new(-0.5, 0.25, -4.0));
    fs::write(dir.path().join("sparse/0/points3D.txt"), "# none\n").unwrap();
    assert_same(&load(&dir).unwrap().scene, &empty);
    fs::remove_file(dir.path().join("sparse/0/points3D.txt")).unwrap();
    assert_same(&load(&dir).unwrap().scene, &empty);
}

#[test]
fn converted_images_are_found() {
    let images = IMAGES.replace("view_0.png", "view_0.JPG");
    load(&text_scene(CAMERAS, &images, POINTS)).unwrap();
}

#[test]
fn bad_models_are_named_with_file_and_view() {
    let (cameras, images, points) = (CAMERAS, IMAGES, POINTS);
    let edit = |text: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    };
    let in_cameras = |from, to| [edit(cameras, from, to), images.into(), points.into()];
    let in_images = |from, to| [cameras.into(), edit(images, from, to), points.into()];
    let in_points = |from, to| [cameras.into(), images.into(), edit(points, from, to)];
    let panorama = "camera 2 has the model EQUIRECTANGULAR, which is not read: \
                    run `colmap image_undistorter`";
    let bad: [([String; 3], &[&str]); 24] = [
        (
            in_cameras("SIMPLE_RADIAL 12 8 20 6 4 0", "EQUIRECTANGULAR 12 8 12 6"),
            &["cameras.txt", panorama],
        ),
        (
            in_cameras("PINHOLE", "SPHERE"),
            &["cameras.txt", "camera 7 has the model SPHERE"],
        ),
        (
            in_images("\n1 1 0", "\n3 1 0"),
            &["images.txt", "image 3 appears twice"],
        ),
        (
            in_images("1.5 2.5 -1", "inf 2.5 -1"),
            &["images.txt", "a point is not finite"],
        ),
        (
            in_points("1 0 3 1", "1 0 3"),
            &["points3D.txt", "line 1: it ends before POINT2D_IDX"],
        ),
        (
            in_cameras("20 6 4 0", "NaN 6 4 0"),
            &["cameras.txt", "view_0", "not finite"],
        ),
        (
            in_cameras("20 6 4 0", "-20 6 4 0"),
            &["cameras.txt", "view_0", "focal"],
        ),
        (
            in_cameras("2 SIMPLE", "7 SIMPLE"),
            &["cameras.txt", "camera 7 appears twice"],
        ),
        (
            in_cameras("2 SIMPLE", "5 SIMPLE"),
            &["images.txt", "`view_0` has the camera 2"],
        ),
        (
            in_cameras("L 12 8", "L 99999999999 8"),
            &["cameras.txt", "camera 2 has images of 9"],
        ),
        (
            in_cameras("L 12 8", "L 13 8"),
            &["images.txt", "view_0", "13×8"],
        ),
        (
            in_cameras(" 6.5 4", ""),
            &["cameras.txt", "camera 7: it ends before PARAMS"],
        ),
        (
            in_images("1 1 0 0 0 ", "1 0 0 0 0 "),
            &["images.txt", "`view_0` is not a rotation"],
        ),
        (
            in_images("1 1 0 0 0 ", "1 1e300 0 0 0 "),
            &["images.txt", "view_0", "not a rotation"],
        ),
        (
            in_images("1 1 0 0 0 ", "1 1 0 nan 0 "),
            &["images.txt", "view_0", "not finite"],
        ),
        (
            in_images("-0.25", "-inf"),
            &["images.txt", "view_0", "not finite"],
        ),
        (
            in_images("-0.25", "O.25"),
            &["images.txt", "view_0.png", "`O.25` cannot be TY"],
        ),
        (
            in_images("4 2 view_0.png\n", ""),
            &["images.txt", "line 4: expected IMAGE_ID"],
        ),
        (
            in_images("right/view_1", "view_0"),
            &["images.txt", "`view_0` appears twice"],
        ),
        (
            in_images("right/view_1", "right/view_0"),
            &["images.txt", "`view_0` appears twice"],
        ),
        (
            in_images("right/", "../images/"),
            &["images.txt", "../images/view_1.png", "rename"],
        ),
        (
            in_images("right/", "/"),
            &["images.txt", "`/view_1.png`", "rename"],
        ),
        (
            in_points("20 30", "20 inf"),
            &["points3D.txt", "not finite"],
        ),
        (in_points("20 30", "20"), &["points3D.txt", "line 1"]),
    ];
    for ([cameras, images, points], expected) in bad {
        let error = load(&text_scene(&cameras, &images, &points)).unwrap_err();
        let message = error.to_string();
        for part in expected {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }
    let none = load(&text_scene(cameras, "# none\n", points)).unwrap_err();
    assert!(matches!(none, SceneError::NoView { .. }));
    let empty = load(&text_scene("", images, points)).unwrap_err();
    assert!(matches!(empty, SceneError::Empty { .. }));
}

#[test]
fn truncated_binary_files_are_named() {
    let files = binary_files();
    for (index, name) in ["cameras.bin", "images.bin", "points3D.bin"]
        .into_iter()
        .enumerate()
    {
        let dir = scene_dir();
        for end in 1..files[index].len() {
            let mut cut = files.clone();
            cut[index].truncate(end);
            write_binary(dir.path(), &cut);
            let message = load(&dir).unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
            assert!(message.contains("ends within"), "{message}");
        }
    }
    let mut unknown = files;
    unknown[0][12..16].copy_from_slice(&18i32.to_le_bytes());
    let dir = scene_dir();
    write_binary(dir.path(), &unknown);
    let message = load(&dir).unwrap_err().to_string();
    assert!(
        message.contains("camera 7 has the model number 18"),
        "{message}"
    );
}
