//! Names in the files of a scene never lead out of its folder.

use image::{Rgb, RgbImage};
use neat_core::convert::{SceneFormat, convert};
use neat_core::layout::{Layout, SceneWarning, abc};
use neat_core::{LoadOptions, LoadedScene, SceneError, load_scene};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const GOOD: [u8; 3] = [10, 20, 30];
const SECRET: [u8; 3] = [200, 100, 50];

/// `secret.png` and a folder `scene` with `images/b.png` and `images/c.png`.
fn secret_beside_scene() -> (TempDir, PathBuf) {
    let parent = tempfile::tempdir().unwrap();
    let scene = parent.path().join("scene");
    fs::create_dir_all(scene.join("images")).unwrap();
    let image = |color| RgbImage::from_pixel(12, 8, Rgb(color));
    image(SECRET)
        .save(parent.path().join("secret.png"))
        .unwrap();
    for name in ["b.png", "c.png"] {
        image(GOOD).save(scene.join("images").join(name)).unwrap();
    }
    (parent, scene)
}

/// A layout, and its files for images of these names.
type Format = (Layout, fn(&[&str]) -> Vec<(&'static str, Vec<u8>)>);

fn pose(x: usize) -> serde_json::Value {
    json!([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, -4], [0, 0, 0, 1]])
}

fn cameras_json(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    let frame = |(x, name): (usize, &&str)| {
        json!({"file": name, "width": 12, "height": 8, "c2w": pose(x),
            "K": [[20, 0, 6], [0, 21, 4], [0, 0, 1]]})
    };
    let frames: Vec<_> = names.iter().enumerate().map(frame).collect();
    let text = json!({ "frames": frames }).to_string();
    vec![("cameras.json", text.into())]
}

fn transforms_json(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    let frame = |(x, name): (usize, &&str)| json!({"file_path": name, "transform_matrix": pose(x)});
    let frames: Vec<_> = names.iter().enumerate().map(frame).collect();
    let text = json!({"fl_x": 20, "frames": frames}).to_string();
    vec![("transforms.json", text.into())]
}

fn meta_data_json(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    let frame = |(x, name): (usize, &&str)| {
        json!({"rgb_path": name, "camtoworld": pose(x),
            "intrinsics": [[20, 0, 6], [0, 21, 4], [0, 0, 1]]})
    };
    let frames: Vec<_> = names.iter().enumerate().map(frame).collect();
    let text = json!({"width": 12, "height": 8, "frames": frames}).to_string();
    vec![("meta_data.json", text.into())]
}

fn openmvg(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    let indices = || names.iter().enumerate();
    let view = |(key, name): (usize, &&str)| {
        json!({"key": key, "value": {"ptr_wrapper": {"data": {"filename": name, "width": 12,
            "height": 8, "id_intrinsic": 0, "id_pose": key}}}})
    };
    let pose = |(key, _): (usize, &&str)| {
        json!({"key": key, "value": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            "center": [key, 0, -4]}})
    };
    let text = json!({
        "root_path": "..",
        "views": indices().map(view).collect::<Vec<_>>(),
        "intrinsics": [{"key": 0, "value": {"polymorphic_id": 1, "polymorphic_name": "pinhole",
            "ptr_wrapper": {"data": {"focal_length": 20, "principal_point": [6, 4]}}}}],
        "extrinsics": indices().map(pose).collect::<Vec<_>>(),
    });
    vec![("sfm_data.json", text.to_string().into())]
}

fn colmap_text(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    let image = |(x, name): (usize, &&str)| format!("{} 1 0 0 0 {x} 0 4 1 {name}\n\n", x + 1);
    let images: String = names.iter().enumerate().map(image).collect();
    vec![
        ("sparse/0/cameras.txt", b"1 PINHOLE 12 8 20 21 6 4\n".into()),
        ("sparse/0/images.txt", images.into()),
    ]
}

fn colmap_binary(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    let mut cameras = [1u64.to_le_bytes().as_slice(), &[1, 0, 0, 0, 1, 0, 0, 0]].concat();
    cameras.extend([12u64, 8].map(u64::to_le_bytes).concat());
    cameras.extend([20.0, 21.0, 6.0, 4.0].map(f64::to_le_bytes).concat());
    let mut images = (names.len() as u64).to_le_bytes().to_vec();
    for (index, name) in names.iter().enumerate() {
        images.extend((index as u32).to_le_bytes());
        let x = index as f64;
        images.extend(
            [1.0, 0.0, 0.0, 0.0, x, 0.0, 4.0]
                .map(f64::to_le_bytes)
                .concat(),
        );
        images.extend(1u32.to_le_bytes());
        images.extend(name.as_bytes());
        images.push(0);
        images.extend(0u64.to_le_bytes());
    }
    vec![
        ("sparse/0/cameras.bin", cameras),
        ("sparse/0/images.bin", images),
    ]
}

fn nvm(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    let camera = |(x, name): (usize, &&str)| format!("{name} 20 1 0 0 0 {x} 0 -4 0 0\n");
    let cameras: String = names.iter().enumerate().map(camera).collect();
    vec![(
        "a.nvm",
        format!("NVM_V3\n\n{}\n{cameras}\n0\n", names.len()).into(),
    )]
}

fn bundler(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    let camera = |x| format!("20 0 0\n1 0 0\n0 1 0\n0 0 1\n{x} 0 -4\n");
    let cameras: String = (0..names.len()).map(camera).collect();
    let bundle = format!("# Bundle file v0.3\n{} 0\n{cameras}", names.len());
    vec![
        ("list.txt", names.join("\n").into()),
        ("bundle.out", bundle.into()),
    ]
}

fn openmvs(names: &[&str]) -> Vec<(&'static str, Vec<u8>)> {
    const POSE: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -4.0];
    let count = |count: usize| (count as u64).to_le_bytes();
    let mut bytes = b"MVSI\x02\0\0\0\0\0\0\0".to_vec();
    // One platform without a name, one camera without a name.
    for number in [1, 0, 1, 0] {
        bytes.extend(count(number));
    }
    bytes.extend([12u32, 8].map(u32::to_le_bytes).concat());
    let k = [20.0, 0.0, 6.0, 0.0, 21.0, 4.0, 0.0, 0.0, 1.0];
    bytes.extend(k.map(f64::to_le_bytes).concat());
    bytes.extend(POSE.map(f64::to_le_bytes).concat());
    bytes.extend(count(1));
    bytes.extend(POSE.map(f64::to_le_bytes).concat());
    bytes.extend(count(names.len()));
    for name in names {
        bytes.extend(count(name.len()));
        bytes.extend(name.as_bytes());
        bytes.extend([0; 12]);
    }
    bytes.extend(count(0));
    vec![("scene.mvs", bytes)]
}

const FORMATS: [Format; 9] = [
    (Layout::CamerasJson, cameras_json),
    (Layout::TransformsJson, transforms_json),
    (Layout::MetaDataJson, meta_data_json),
    (Layout::OpenMvg, openmvg),
    (Layout::Colmap, colmap_text),
    (Layout::Colmap, colmap_binary),
    (Layout::VisualSfm, nvm),
    (Layout::Bundler, bundler),
    (Layout::OpenMvs, openmvs),
];

fn load(scene: &Path, layout: Layout) -> Result<LoadedScene, SceneError> {
    let options = LoadOptions {
        layout: Some(layout),
        require_wireframes: false,
        ..LoadOptions::default()
    };
    load_scene(scene, &options)
}

/// Loads the scene with images of these names in each format.
fn load_all(scene: &Path, names: &[&str], check: impl Fn(Layout, Result<LoadedScene, SceneError>)) {
    for (layout, files) in FORMATS {
        let files = files(names);
        for (name, bytes) in &files {
            let path = scene.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        check(layout, load(scene, layout));
        for (name, _) in files {
            fs::remove_file(scene.join(name)).unwrap();
        }
    }
}

/// No file outside was read, and no view is called what is no file name.
fn assert_stays_inside(scene: &Path, loaded: &LoadedScene, what: &str) {
    let scene = scene.canonicalize().unwrap();
    for file in &loaded.files {
        let file = file.canonicalize().unwrap();
        assert!(
            file.starts_with(&scene),
            "{what}: {} was read",
            file.display()
        );
    }
    for view in &loaded.scene.views {
        assert!(
            ["b", "c"].contains(&view.name.as_str()),
            "{what}: {}",
            view.name
        );
    }
}

#[test]
fn names_of_images_stay_below_the_scene() {
    let (parent, scene) = secret_beside_scene();
    let secret = parent.path().join("secret.png");
    let long = "x".repeat(5000) + ".png";
    let deep = "x/".repeat(3000) + "secret.png";
    for name in [
        "../secret.png",
        "images/../../secret.png",
        "./../secret.png",
        secret.to_str().unwrap(),
        "//secret.png",
        r"..\secret.png",
        r"C:\secret.png",
        r"C:secret.png",
        r"\\server\share\secret.png",
        r"\\?\C:\secret.png",
        "file:///secret.png",
        "%2e%2e/secret.png",
        "~/secret.png",
        "..",
        ".",
        "/",
        "images",
        "/dev/zero",
        "/dev/stdin",
        "CON.png",
        "nul",
        "b\0.png",
        "images/b.png\0/../../../secret.png",
        "b\u{7}.png",
        &long,
        &deep,
    ] {
        load_all(
            &scene,
            &[name, "images/b.png", "images/c.png"],
            |layout, result| {
                // Refused, or left out as an image that is not there.
                if let Ok(loaded) = result {
                    assert_stays_inside(&scene, &loaded, &format!("{layout}, {name:?}"));
                }
            },
        );
    }
}

#[test]
fn names_of_point_clouds_stay_below_the_scene() {
    let (parent, scene) = secret_beside_scene();
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n\
        property float y\nproperty float z\nend_header\n1 2 3\n";
    let secret = parent.path().join("secret.ply");
    fs::write(&secret, ply).unwrap();
    fs::write(scene.join("points.ply"), ply).unwrap();
    let points = |name: &str| {
        let [(file, text)] = &transforms_json(&["images/b.png", "images/c.png"])[..] else {
            panic!("one file");
        };
        let mut json: serde_json::Value = serde_json::from_slice(text).unwrap();
        json["ply_file_path"] = name.into();
        fs::write(scene.join(file), json.to_string()).unwrap();
        let loaded = load(&scene, Layout::TransformsJson).unwrap();
        loaded.scene.sparse_points.len()
    };
    assert_eq!(points("points.ply"), 1);
    for name in [
        "../secret.ply",
        secret.to_str().unwrap(),
        "images/../../secret.ply",
    ] {
        assert_eq!(points(name), 0, "{name}");
    }
}

#[test]
fn names_that_are_as_they_should_be_are_read() {
    let (_parent, scene) = secret_beside_scene();
    for (layout, files) in FORMATS {
        // COLMAP names images below its folder of images.
        let names: &[&str] = match layout {
            Layout::Colmap => &["b.png", "c.png"],
            _ => &["images/b.png", "images/c.png"],
        };
        for (name, bytes) in files(names) {
            let path = scene.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        let loaded = load(&scene, layout).unwrap();
        assert_eq!(loaded.scene.views.len(), 2, "{layout}");
        assert_stays_inside(&scene, &loaded, &layout.to_string());
        let told = |warning: &SceneWarning| matches!(warning, SceneWarning::LinksOutside { .. });
        assert!(!loaded.warnings.iter().any(told));
        let _ = fs::remove_dir_all(scene.join("sparse"));
    }
}

#[test]
fn scenes_with_names_that_are_no_files_are_not_written() {
    let (parent, scene) = secret_beside_scene();
    let files = cameras_json(&["images/b.png", "images/c.png"]);
    fs::write(scene.join("cameras.json"), &files[0].1).unwrap();
    let good = load(&scene, Layout::CamerasJson).unwrap().scene;
    let long = "x".repeat(300);
    for name in [
        "../out", "a/b", r"a\b", "/out", "..", "", "a\0", "aux", "a\r\n", &long,
    ] {
        let mut bad = good.clone();
        bad.views[0].name = name.into();
        bad.views.truncate(1);
        let formats = [
            SceneFormat::Abc,
            SceneFormat::Colmap,
            SceneFormat::CamerasNpz,
            SceneFormat::TransformsJson,
        ];
        for (index, format) in formats.into_iter().enumerate() {
            let dir = parent.path().join(format!("written-{index}"));
            let error = convert(&bad, format, &dir).unwrap_err();
            assert!(
                matches!(error, SceneError::ViewName { .. }),
                "{name:?}: {error}"
            );
            assert!(!dir.exists());
        }
        let error = abc::write_scene(&bad, &parent.path().join("abc")).unwrap_err();
        assert!(
            matches!(error, SceneError::ViewName { .. }),
            "{name:?}: {error}"
        );
    }
    let mut names: Vec<_> = fs::read_dir(parent.path()).unwrap().flatten().collect();
    names.sort_by_key(|entry| entry.file_name());
    let names: Vec<_> = names.iter().map(|entry| entry.file_name()).collect();
    assert_eq!(names, ["scene", "secret.png"]);
}

#[cfg(unix)]
mod links {
    use super::*;
    use std::os::unix::fs::symlink;
    use std::process::Command;

    fn scene_of(target: &Path) -> (TempDir, PathBuf) {
        let (parent, scene) = secret_beside_scene();
        symlink(target, scene.join("images/a.png")).unwrap();
        let files = cameras_json(&["images/a.png", "images/b.png", "images/c.png"]);
        fs::write(scene.join("cameras.json"), &files[0].1).unwrap();
        (parent, scene)
    }

    #[test]
    fn links_to_images_elsewhere_are_read_and_told() {
        let (_parent, scene) = scene_of(Path::new("../../secret.png"));
        let loaded = load(&scene, Layout::CamerasJson).unwrap();
        assert_eq!(loaded.scene.views.len(), 3);
        let [warning] = loaded
            .warnings
            .iter()
            .filter(|warning| matches!(warning, SceneWarning::LinksOutside { .. }))
            .collect::<Vec<_>>()[..]
        else {
            panic!("one warning: {:?}", loaded.warnings);
        };
        let text = warning.to_string();
        assert!(text.contains("a.png") && text.contains("1 file"), "{text}");
        // The scene itself may be behind a link.
        let link = scene.with_file_name("link");
        symlink(&scene, &link).unwrap();
        fs::remove_file(scene.join("images/a.png")).unwrap();
        fs::copy(scene.join("images/b.png"), scene.join("images/a.png")).unwrap();
        let warnings = load(&link, Layout::CamerasJson).unwrap().warnings;
        let told = |warning: &SceneWarning| matches!(warning, SceneWarning::LinksOutside { .. });
        assert!(!warnings.iter().any(told), "{warnings:?}");
    }

    #[test]
    fn links_that_lead_nowhere_are_told_from_files_that_are_not_there() {
        let (_parent, scene) = scene_of(Path::new("a.png"));
        let warnings = load(&scene, Layout::CamerasJson).unwrap().warnings;
        let text = format!("{warnings:?}");
        let left_out: Vec<_> = warnings.iter().map(ToString::to_string).collect();
        let told = |text: &String| text.contains("a.png, a link that leads to no file");
        assert!(left_out.iter().any(told), "{text}");
        for name in ["b.png", "c.png"] {
            fs::remove_file(scene.join("images").join(name)).unwrap();
            symlink("nowhere", scene.join("images").join(name)).unwrap();
        }
        let error = load(&scene, Layout::CamerasJson).unwrap_err().to_string();
        assert!(error.contains("link that leads to no file"), "{error}");
    }

    #[test]
    fn devices_pipes_and_folders_are_no_files() {
        let (_parent, scene) = scene_of(Path::new("/dev/zero"));
        let image = scene.join("images/a.png");
        let message = |name: &str| {
            let error = load(&scene, Layout::CamerasJson).unwrap_err();
            let cause = std::error::Error::source(&error).map(ToString::to_string);
            let text = format!("{error}: {}", cause.unwrap_or_default());
            assert!(
                text.contains(name) && text.contains("regular file"),
                "{text}"
            );
        };
        message("a.png");
        fs::remove_file(&image).unwrap();
        fs::create_dir(&image).unwrap();
        message("a.png");
        fs::remove_dir(&image).unwrap();
        // Opening a pipe that nobody writes to would wait forever.
        let pipe = |path: &Path| Command::new("mkfifo").arg(path).status().unwrap();
        assert!(pipe(&image).success());
        message("a.png");
        fs::remove_file(scene.join("cameras.json")).unwrap();
        assert!(pipe(&scene.join("cameras.json")).success());
        message("cameras.json");
    }
}
