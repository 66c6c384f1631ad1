//! Every reader of files from outside, fed with bytes.
//!
//! A reader may refuse what it is given; it must not panic, hang, or return what its
//! own checks would not pass. Layouts of scenes are read by `load_scene` from a folder
//! that holds two small images, so that what follows the parser (lenses, the scene
//! sphere, points) sees hostile numbers too.

use crate::seeds;
use image::RgbImage;
use neat_core::layout::{self, Layout};
use neat_core::npz::{NpzReader, parse_npy};
use neat_core::{LoadOptions, ground_truth, hawp_json, load_scene, ply};
use neat_detect::{edge_map, segment_file};
use neat_eval::{EdgeModel, SceneTruth, TriangleMesh, foreign, mat_file};
use neat_wireframe::export;
use neat_wireframe::validity::check_wireframe;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A reader of bytes from outside.
pub struct Reader {
    /// Its name, also of the folder with what fuzzing it has found.
    pub name: &'static str,
    /// Reads the bytes and says whether they were accepted; panics if the result is not
    /// what it has to be.
    pub read: fn(&[u8]) -> bool,
    /// Files that it can read.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

macro_rules! readers {
    ($($name:ident)*) => {
        /// All readers that can be built without a learning framework.
        pub const READERS: &[Reader] = &[
            $(Reader { name: stringify!($name), read: $name, seeds: seeds::$name }),*
        ];
    };
}

readers! {
    abc dtu cameras_json transforms_json colmap_binary colmap_text meta_data_json openmvg openmvs
    nvm bundler strecha points_of_scene hawp wireframe_of_truth ply npy npz picture
    segments_npz segments_text edge_picture
    mat obj ply_edges numpy_lines neat_npz line3dpp parametric_edges true_edges triangle_mesh
    wireframe_json limap_tracks limap_track limap_images
}

/// Stands between the files of inputs that are several.
pub const SEPARATOR: &[u8] = b"\n%%\n";

/// The file at `index` of an input that is several.
fn part(bytes: &[u8], index: usize) -> &[u8] {
    let mut rest = bytes;
    for _ in 0..index {
        let width = SEPARATOR.len();
        let Some(at) = rest.windows(width).position(|window| window == SEPARATOR) else {
            return &[];
        };
        rest = &rest[at + width..];
    }
    let width = SEPARATOR.len();
    let end = rest.windows(width).position(|window| window == SEPARATOR);
    &rest[..end.unwrap_or(rest.len())]
}

/// Whether a file was accepted; what was read must pass `check`.
fn accepted<T, E>(result: Result<T, E>, check: impl FnOnce(T)) -> bool {
    result.map(check).is_ok()
}

/// Reads a scene with two images, whose poses are in `files`, below its folder.
fn scene(layout: Layout, files: &[&str], bytes: &[u8]) -> bool {
    thread_local! {
        static FOLDER: TempDir = two_images();
    }
    FOLDER.with(|folder| {
        let folder = folder.path();
        let paths: Vec<PathBuf> = files.iter().map(|name| folder.join(name)).collect();
        for (index, path) in paths.iter().enumerate() {
            fs::create_dir_all(path.parent().unwrap_or(folder)).expect("a folder for a file");
            fs::write(path, part(bytes, index)).expect("a file in a temporary folder");
        }
        let options = LoadOptions {
            layout: Some(layout),
            require_wireframes: false,
            max_views: Some(3),
            ..LoadOptions::default()
        };
        let loaded = load_scene(folder, &options);
        for path in paths {
            fs::remove_file(path).expect("a file that was just written");
        }
        accepted(loaded, |loaded| {
            let scene = loaded.scene;
            scene.validate().expect("readers check what they return");
        })
    })
}

/// A folder with two images of 12×8 pixels, under both names that layouts look for.
fn two_images() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["images", "image"] {
        let images = folder.path().join(name);
        fs::create_dir(&images).expect("a folder of images");
        for name in ["a.png", "b.png"] {
            let image =
                RgbImage::from_fn(12, 8, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 9]));
            image.save(images.join(name)).expect("an image");
        }
    }
    folder
}

fn abc(bytes: &[u8]) -> bool {
    scene(Layout::Abc, &["cameras.npz"], bytes)
}

fn dtu(bytes: &[u8]) -> bool {
    scene(Layout::Dtu, &["cameras_sphere.npz"], bytes)
}

fn cameras_json(bytes: &[u8]) -> bool {
    scene(Layout::CamerasJson, &["cameras.json"], bytes)
}

fn transforms_json(bytes: &[u8]) -> bool {
    scene(Layout::TransformsJson, &["transforms.json"], bytes)
}

fn colmap_binary(bytes: &[u8]) -> bool {
    let files = [
        "sparse/0/cameras.bin",
        "sparse/0/images.bin",
        "sparse/0/points3D.bin",
    ];
    scene(Layout::Colmap, &files, bytes)
}

fn colmap_text(bytes: &[u8]) -> bool {
    let files = [
        "sparse/0/cameras.txt",
        "sparse/0/images.txt",
        "sparse/0/points3D.txt",
    ];
    scene(Layout::Colmap, &files, bytes)
}

fn meta_data_json(bytes: &[u8]) -> bool {
    scene(Layout::MetaDataJson, &["meta_data.json"], bytes)
}

fn openmvg(bytes: &[u8]) -> bool {
    scene(Layout::OpenMvg, &["sfm_data.json"], bytes)
}

fn openmvs(bytes: &[u8]) -> bool {
    scene(Layout::OpenMvs, &["scene.mvs"], bytes)
}

fn nvm(bytes: &[u8]) -> bool {
    scene(Layout::VisualSfm, &["model.nvm"], bytes)
}

fn bundler(bytes: &[u8]) -> bool {
    scene(Layout::Bundler, &["list.txt", "bundle.out"], bytes)
}

fn strecha(bytes: &[u8]) -> bool {
    let files = ["images/a.png.camera", "images/b.png.camera"];
    scene(Layout::Strecha, &files, bytes)
}

/// The cloud of points beside poses that are as they should be.
fn points_of_scene(bytes: &[u8]) -> bool {
    let poses = seeds::cameras_json().concat();
    let files = [poses.as_slice(), bytes].join(SEPARATOR);
    scene(
        Layout::CamerasJson,
        &["cameras.json", "sparse_points.ply"],
        &files,
    )
}

fn hawp(bytes: &[u8]) -> bool {
    accepted(
        hawp_json::parse(bytes, 0.5, Path::new("a.json")),
        |wireframe| {
            wireframe.validate().expect("a checked wireframe");
            let segments = wireframe.segments(0.0);
            assert!(segments.len() <= wireframe.edges.len());
        },
    )
}

fn wireframe_of_truth(bytes: &[u8]) -> bool {
    accepted(ground_truth::parse(bytes, Path::new("gt.json")), |truth| {
        check_wireframe(&truth.wireframe.junctions, &truth.wireframe.edges).expect("checked");
    })
}

fn ply(bytes: &[u8]) -> bool {
    accepted(ply::parse_points(bytes, Path::new("a.ply")), |points| {
        assert!(points.iter().flatten().all(|x| x.is_finite()));
    })
}

fn npy(bytes: &[u8]) -> bool {
    accepted(parse_npy(bytes, Path::new("a.npy")), |array| {
        assert_eq!(array.shape.iter().product::<usize>(), array.values.len());
    })
}

fn npz(bytes: &[u8]) -> bool {
    let archive = NpzReader::from_bytes(bytes.to_vec(), Path::new("a.npz"));
    let array = archive.and_then(|mut archive| archive.array("lines"));
    accepted(array, |_| {})
}

fn picture(bytes: &[u8]) -> bool {
    thread_local! {
        static FOLDER: TempDir = tempfile::tempdir().expect("a temporary folder");
    }
    FOLDER.with(|folder| {
        let path = folder.path().join("a.png");
        fs::write(&path, bytes).expect("a file in a temporary folder");
        accepted(layout::read_image(&path, [9; 3]), |_| {})
    })
}

fn segments_in(bytes: &[u8], name: &str) -> bool {
    accepted(
        segment_file::parse(bytes.to_vec(), Path::new(name)),
        |segments| {
            let ends = segments.iter().flat_map(|segment| segment.ends());
            assert!(ends.flat_map(|end| [end.x, end.y]).all(f64::is_finite));
        },
    )
}

fn segments_npz(bytes: &[u8]) -> bool {
    segments_in(bytes, "a.npz")
}

fn segments_text(bytes: &[u8]) -> bool {
    segments_in(bytes, "a.txt")
}

fn edge_picture(bytes: &[u8]) -> bool {
    accepted(edge_map::parse(bytes, Path::new("a.png")), |map| {
        // Larger ones take seconds, which is no news.
        if map.width().max(map.height()) <= 256 {
            let _ = edge_map::segments(&map);
        }
    })
}

fn mat(bytes: &[u8]) -> bool {
    accepted(mat_file::parse_mat(bytes, Path::new("a.mat")), |arrays| {
        for array in arrays {
            assert_eq!(array.numbers().len(), array.len());
        }
    })
}

fn check_model(model: EdgeModel) {
    let wireframe = model.wireframe;
    check_wireframe(&wireframe.junctions, &wireframe.edges).expect("a checked wireframe");
}

fn obj(bytes: &[u8]) -> bool {
    accepted(foreign::parse_obj(bytes, Path::new("a.obj")), |wireframe| {
        check_model(wireframe.into());
    })
}

fn ply_edges(bytes: &[u8]) -> bool {
    accepted(
        foreign::parse_ply_edges(bytes, Path::new("a.ply")),
        |wireframe| {
            check_model(wireframe.into());
        },
    )
}

fn numpy_lines(bytes: &[u8]) -> bool {
    accepted(
        foreign::parse_npy_lines(bytes, Path::new("a.npy")),
        |wireframe| {
            check_model(wireframe.into());
        },
    )
}

fn neat_npz(bytes: &[u8]) -> bool {
    accepted(
        foreign::parse_neat_npz(bytes, Path::new("a.npz")),
        |wireframe| {
            check_model(wireframe.into());
        },
    )
}

fn line3dpp(bytes: &[u8]) -> bool {
    accepted(
        foreign::parse_line3dpp(bytes, Path::new("a.txt")),
        |wireframe| {
            check_model(wireframe.into());
        },
    )
}

fn parametric_edges(bytes: &[u8]) -> bool {
    accepted(
        foreign::parse_parametric_edges(bytes, Path::new("a.json")),
        |model| {
            check_model(model);
        },
    )
}

/// The straight edges of a rendered scene's truth.
fn true_edges(bytes: &[u8]) -> bool {
    let path = Path::new("wireframe.json");
    accepted(SceneTruth::parse_wireframe(bytes, path), |truth| {
        let views = truth.edge_views.map_or(0, |views| views.len());
        assert!(views <= truth.wireframe.edges.len());
        check_model(truth.wireframe.into());
    })
}

fn triangle_mesh(bytes: &[u8]) -> bool {
    accepted(TriangleMesh::parse(bytes, Path::new("mesh.ply")), |mesh| {
        let corners = mesh.triangles.iter().flatten();
        assert!(
            corners
                .max()
                .is_none_or(|corner| (*corner as usize) < mesh.vertices.len())
        );
    })
}

fn wireframe_json(bytes: &[u8]) -> bool {
    let path = Path::new("wireframe.json");
    accepted(export::parse_json(bytes, path), |document| {
        document.check(path).expect("a checked document");
    })
}

fn check_tracks(tracks: &[export::LineTrack]) {
    let ends = tracks.iter().flat_map(|track| track.segment.ends());
    assert!(
        ends.flat_map(|end| [end.x, end.y, end.z])
            .all(f64::is_finite)
    );
}

fn limap_tracks(bytes: &[u8]) -> bool {
    accepted(
        export::parse_all_tracks(bytes, Path::new("alltracks.txt")),
        |tracks| {
            check_tracks(&tracks);
        },
    )
}

fn limap_track(bytes: &[u8]) -> bool {
    accepted(
        export::parse_track(bytes, Path::new("track_0.txt")),
        |track| {
            check_tracks(&[track]);
        },
    )
}

fn limap_images(bytes: &[u8]) -> bool {
    let images = export::parse_image_list(bytes, Path::new("image_list.txt"));
    accepted(images, |_| {})
}
