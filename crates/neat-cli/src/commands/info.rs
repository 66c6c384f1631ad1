//! `neat info`.

use crate::error::CliError;
use crate::output;
use clap::Args;
use neat_core::layout::Layout;
use neat_core::{LoadOptions, LoadedScene, View, load_scene};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;

/// Say what is in the folder of a scene, and what is wrong with it
#[derive(Debug, Args)]
#[command(after_help = "\
Layouts that are read:
  images/NAME.png, hawp/NAME.json, cameras.npz with `intrinsics` and `extrinsics`       (ABC)
  image/NAME.png, hawp/NAME.json, cameras.npz with `world_mat_i` and `scale_mat_i`      (DTU)
  cameras.json naming images with `K` and `c2w`, hawp/NAME.json
  transforms.json or transforms_train.json (Blender, nerfstudio), hawp/NAME.json
  images/, hawp/NAME.json, cameras, images and points3D (.bin or .txt) in sparse/0/   (COLMAP)

Poses are camera-to-world in OpenCV axes: x right, y down, z forward; in transforms.json
in OpenGL axes: x right, y up, z backward. Those of COLMAP are read as it writes them. Images
must be undistorted.")]
pub struct InfoArgs {
    /// Folder of the scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Count only segments with a score above this
    #[arg(long, value_name = "SCORE", default_value_t = LoadOptions::default().min_segment_score)]
    min_score: f64,
}

impl InfoArgs {
    pub fn run(self) -> Result<(), CliError> {
        let options = LoadOptions {
            min_segment_score: self.min_score,
            require_wireframes: false,
            ..LoadOptions::default()
        };
        let loaded = load_scene(&self.scene, &options)?;
        output::print(&describe(&loaded, self.min_score))?;
        for warning in warnings(&loaded, self.min_score) {
            output::note(&format!("warning: {warning}"));
        }
        Ok(())
    }
}

fn describe(loaded: &LoadedScene, min_score: f64) -> String {
    let scene = &loaded.scene;
    let layout = match loaded.layout {
        Layout::Abc => "ABC (cameras.npz with intrinsics and extrinsics)",
        Layout::Dtu => "DTU (cameras.npz with world_mat and scale_mat)",
        Layout::CamerasJson => "cameras.json",
        Layout::TransformsJson => "transforms.json (OpenGL axes)",
        Layout::Colmap => "COLMAP (cameras and images of a sparse model)",
    };
    let sizes: BTreeSet<(u32, u32)> = scene
        .views
        .iter()
        .map(|view| view.image.dimensions())
        .collect();
    let sizes: Vec<_> = sizes.iter().map(|(w, h)| format!("{w}×{h}")).collect();
    let statistic = |name: &str, value: &dyn Fn(&View) -> f64, digits: usize| {
        let mut values: Vec<f64> = scene.views.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        let [min, median, max] = [0, values.len() / 2, values.len() - 1].map(|i| values[i]);
        format!("{name:<20}{min:.digits$} to {max:.digits$}, median {median:.digits$}")
    };
    let original = &scene.original_from_world;

    let mut lines = vec![
        format!("{:<20}{}", "scene", scene.name),
        format!("{:<20}{layout}", "layout"),
        format!("{:<20}{}", "views", scene.views.len()),
        format!("{:<20}{}", "image size", sizes.join(", ")),
        statistic(
            "segments per view",
            &|view| view.wireframe.segments(min_score).len() as f64,
            0,
        ),
        statistic(
            "junctions per view",
            &|view| view.wireframe.vertices.len() as f64,
            0,
        ),
        statistic("focal length", &|view| view.camera.intrinsics.fx, 1),
        statistic(
            "camera distance",
            &|view| view.camera.center_in_world.norm(),
            3,
        ),
        format!("{:<20}{}", "scene sphere", loaded.sphere),
        format!("{:<20}{}", "sparse points", scene.sparse_points.len()),
        format!("{:<20}{}", "first pixel centre", scene.pixel_center),
    ];
    if *original != neat_core::Similarity::identity() {
        let mut line = format!("{:<20}", "original frame");
        let t = &original.translation;
        let _ = write!(
            line,
            "world × {} + ({}, {}, {})",
            original.scale, t.x, t.y, t.z
        );
        lines.push(line);
    }
    lines.join("\n")
}

fn warnings(loaded: &LoadedScene, min_score: f64) -> Vec<String> {
    let scene = &loaded.scene;
    let mut warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let empty: Vec<&str> = scene
        .views
        .iter()
        .filter(|view| view.wireframe.segments(min_score).is_empty())
        .map(|view| view.name.as_str())
        .collect();
    if empty.len() == scene.views.len() {
        warnings.push(format!(
            "no view has a segment with a score above {min_score}: detect 2D wireframes and put them into hawp/"
        ));
    } else if !empty.is_empty() {
        warnings.push(format!(
            "views without a segment, which are left out of training: {}",
            empty.join(", ")
        ));
    }
    let radius = scene.sphere_radius;
    let inside = scene
        .views
        .iter()
        .filter(|view| view.camera.center_in_world.norm() < radius)
        .count();
    if inside > 0 {
        warnings.push(format!(
            "{inside} cameras stand within the scene ball: set data.scene_radius to the object's size"
        ));
    }
    let blind = scene.views.iter().filter(|view| !sees_origin(view)).count();
    if blind > 0 {
        warnings.push(format!(
            "{blind} cameras do not see the world origin: a ball around it is modelled, so move the origin of the poses into the object"
        ));
    }
    warnings
}

fn sees_origin(view: &View) -> bool {
    let camera = &view.camera;
    let projection = camera.project(&Default::default());
    let within = |x: f64, size: u32| (0.0..f64::from(size)).contains(&x);
    projection.depth > 0.0
        && within(projection.pixel.x, camera.width)
        && within(projection.pixel.y, camera.height)
}
