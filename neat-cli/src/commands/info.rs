//! `neat info`.

use crate::error::CliError;
use crate::output;
use crate::scene_arguments::SceneArgs;
use clap::Args;
use neat_core::{LoadOptions, LoadedScene, View, load_scene};
use neat_pipeline::resources::default_limit;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;

/// Say what is in the folder of a scene, and what is wrong with it
#[derive(Debug, Args)]
#[command(after_help = "\
Layouts that are read, looked for in this order; all with hawp/NAME.json:
  image/NAME.png, cameras_sphere.npz or cameras.npz with `world_mat_i`, `scale_mat_i`  (DTU)
  images/NAME.png, cameras.npz with `intrinsics` and `extrinsics`                       (ABC)
  cameras.json naming images with `K` and `c2w`
  transforms.json or transforms_train.json                     (Blender, nerfstudio)
  cameras, images and points3D (.bin or .txt) in sparse/0/, images/                  (COLMAP)
  meta_data.json naming images with `rgb_path`                           (sdfstudio, EMAP)
  sfm_data.json                                                                     (OpenMVG)
  scene.mvs in the interface format                                                 (OpenMVS)
  NAME.nvm                                                                        (VisualSfM)
  bundle.out or bundle/bundle.out, and list.txt                                     (Bundler)
  gt_dense_cameras/NAME.jpg.camera                                                  (Strecha)

Poses are those that each program writes; they are turned into camera-to-world in OpenCV
axes: x right, y down, z forward.")]
pub struct InfoArgs {
    /// Folder of the scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Count only segments with a score above this
    #[arg(long, value_name = "SCORE", default_value_t = LoadOptions::default().min_segment_score)]
    min_score: f64,
    #[command(flatten)]
    scene_args: SceneArgs,
}

impl InfoArgs {
    pub fn run(self) -> Result<(), CliError> {
        let options = LoadOptions {
            min_segment_score: self.min_score,
            ..self.scene_args.load_options(None, default_limit())
        };
        let loaded = load_scene(&self.scene, &options)?;
        output::print(&describe(&loaded, self.min_score))?;
        for warning in warnings(&loaded, self.min_score) {
            output::warning(&warning.to_string());
        }
        Ok(())
    }
}

fn describe(loaded: &LoadedScene, min_score: f64) -> String {
    let scene = &loaded.scene;
    let layout = loaded.layout;
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
            "there are no 2D wireframes with a segment above {min_score}: without a folder hawp/ `neat reconstruct` detects them"
        ));
    } else if !empty.is_empty() {
        warnings.push(format!(
            "views without a segment, which are left out of training: {}",
            empty.join(", ")
        ));
    }
    warnings
}
