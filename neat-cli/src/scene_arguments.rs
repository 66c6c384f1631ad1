//! How a scene is read.

use crate::arguments::{MethodArgs, positive};
use crate::error::CliError;
use clap::Args;
use neat_core::file_cache::FileCache;
use neat_core::layout::{CameraAxes, PoseConvention, PoseDirection};
use neat_core::{LoadOptions, MemoryLimit, SphereChoice};
use neat_pipeline::config::{Config, DataConfig, Preset};
use neat_pipeline::scene::load_options;
use std::fmt;

/// How a scene is read, where its files do not say or say wrongly.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene")]
pub struct SceneArgs {
    /// The part of space to model: around what the file declares, the sparse points, what the
    /// cameras look at, or the masks (file, points, cameras, masks), the first of them that fits
    /// (auto), or x,y,z,radius in the frame of the files
    #[arg(long, value_name = "WHERE", allow_hyphen_values = true)]
    scene_sphere: Option<SphereChoice>,
    /// Use at most so many views, spread evenly over the order of the files
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    max_views: Option<u32>,
    /// Scale images down so that their longer side has at most so many pixels; intrinsics and 2D
    /// wireframes follow
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(16..))]
    max_image_size: Option<u32>,
    /// Where the poses lead: camera-to-world, world-to-camera, transposed-rotation or
    /// world-to-camera-translation
    #[arg(long, value_name = "DIRECTION")]
    poses: Option<PoseDirection>,
    /// Where the camera's x, y and z axes point, such as right-down-forward (OpenCV) or
    /// right-up-back (OpenGL)
    #[arg(long, value_name = "AXES")]
    camera_axes: Option<CameraAxes>,
    /// The world of the poses is left-handed
    #[arg(long)]
    mirrored_world: bool,
    /// Multiply the focal lengths of the files
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
    focal_scale: Option<f64>,
    /// Multiply the intrinsics of the files: 0.5 for images of half the size that they are for
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
    intrinsics_scale: Option<f64>,
}

impl SceneArgs {
    /// How a scene is read with what was given, by commands that need no 2D
    /// wireframes.
    pub fn load_options(
        &self,
        cache: Option<&FileCache>,
        memory_limit: MemoryLimit,
    ) -> LoadOptions {
        LoadOptions {
            require_wireframes: false,
            ..load_options(
                &self.apply(Preset::default().config().data),
                cache,
                memory_limit,
            )
        }
    }

    /// `config`, which `method` made, with everything that was given.
    pub fn configure(&self, mut config: Config, method: &MethodArgs) -> Result<Config, CliError> {
        config.data = self.apply(config.data);
        let options = self.to_string();
        if !options.is_empty() {
            method.check(&config, options.trim_start())?;
        }
        Ok(config)
    }

    /// `data` with everything that was given.
    fn apply(&self, mut data: DataConfig) -> DataConfig {
        if let Some(sphere) = self.scene_sphere {
            data.scene_sphere = sphere;
        }
        data.max_views = (self.max_views.map(|n| n as usize)).or(data.max_views);
        data.max_image_size = self.max_image_size.or(data.max_image_size);
        data.focal_scale = self.focal_scale.or(data.focal_scale);
        data.intrinsics_scale = self.intrinsics_scale.or(data.intrinsics_scale);
        let stored = data.pose_convention.unwrap_or_default();
        let convention = PoseConvention {
            direction: self.poses.unwrap_or(stored.direction),
            axes: self.camera_axes.unwrap_or(stored.axes),
            mirrored_world: self.mirrored_world || stored.mirrored_world,
        };
        if convention != stored {
            data.pose_convention = Some(convention);
        }
        data
    }
}

impl fmt::Display for SceneArgs {
    /// As they were given, each after a space.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut flag = |name: &str, value: Option<String>| match value {
            Some(value) => write!(f, " --{name} {value}"),
            None => Ok(()),
        };
        flag("scene-sphere", self.scene_sphere.map(|x| x.to_string()))?;
        flag("max-views", self.max_views.map(|x| x.to_string()))?;
        flag("max-image-size", self.max_image_size.map(|x| x.to_string()))?;
        flag("poses", self.poses.map(|x| x.to_string()))?;
        flag("camera-axes", self.camera_axes.map(|x| x.to_string()))?;
        flag("focal-scale", self.focal_scale.map(|x| x.to_string()))?;
        flag(
            "intrinsics-scale",
            self.intrinsics_scale.map(|x| x.to_string()),
        )?;
        match self.mirrored_world {
            true => f.write_str(" --mirrored-world"),
            false => Ok(()),
        }
    }
}
