//! `neat render`.

use crate::arguments::BackendArg;
use crate::cache::CacheArgs;
use crate::error::CliError;
use crate::memory::MemoryArgs;
use crate::output;
use crate::progress::Progress;
use clap::Args;
use image::{RgbImage, imageops};
use neat_core::View;
use neat_core::file::{self, write_png};
use neat_eval::image_colouring::{DepthColors, color_image, depth_image, normal_image};
use neat_eval::image_quality::psnr;
use neat_pipeline::reconstruct::{OpenedRun, open_run};
use neat_pipeline::render::{every_nth_pixel, render_view};
use neat_pipeline::resources::Resources;
use std::path::{Path, PathBuf};

/// Render colour, depth and normals of views of a trained run
///
/// A comparison shows each rendering beside its photograph. Prints the PSNR of the colours
/// against the photographs.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat render RUN
  neat render RUN --view image_0007 --view image_0042 --downscale 4
  neat render RUN --view all --downscale 8 --out renders")]
pub struct RenderArgs {
    /// Folder of the run
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Name of a view, or `all`; may be repeated; the first view by default
    #[arg(long, value_name = "NAME")]
    view: Vec<String>,
    /// Render every N-th pixel along both axes
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..))]
    downscale: u32,
    /// Folder for the images instead of RUN/renders
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of the scene, if it is not where the run found it
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    backend: BackendArg,
    #[command(flatten)]
    memory: MemoryArgs,
    #[command(flatten)]
    cache: CacheArgs,
}

impl RenderArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let mut progress = Progress::new(quiet);
        let opened = open_run(
            &self.run,
            self.scene.as_deref(),
            self.backend.backend,
            Resources {
                cache: self.cache.open().as_ref(),
                memory_limit: self.memory.limit(),
                cancelled: None,
            },
            Ok::<_, CliError>,
            &mut |event| progress.show(event),
        )?;
        let views = select(&opened.scene.views, &self.view)?;
        let out = self
            .out
            .unwrap_or_else(|| opened.dir.root().join("renders"));
        file::create_dir(&out)?;
        let mut lines = Vec::new();
        for view in views {
            let psnr = render(&opened, view, self.downscale, &out, &mut progress)?;
            let psnr = psnr.map_or_else(|| "-".to_owned(), |psnr| format!("{psnr:.2} dB"));
            lines.push(format!("{}: PSNR {psnr}", view.name));
        }
        drop(progress);
        lines.push(format!("images: {}", out.display()));
        output::print(&lines.join("\n"))
    }
}

/// Renders one view and writes its images; returns the PSNR.
fn render(
    run: &OpenedRun,
    view: &View,
    downscale: u32,
    out: &Path,
    progress: &mut Progress,
) -> Result<Option<f64>, CliError> {
    let rendered = render_view(
        run.trained_field()?,
        &view.camera,
        run.scene.pixel_center,
        downscale,
        &mut |fraction| progress.show_part(&view.name, fraction),
    );
    let (width, height) = (rendered.width, rendered.height);
    let color = color_image(width, height, &rendered.color);
    let photo = every_nth_pixel(&*view.image.read()?, downscale);
    let images = [
        ("comparison", side_by_side(&color, &photo)),
        ("color", color),
        (
            "depth",
            depth_image(width, height, &rendered.depth, DepthColors::Gray),
        ),
        ("normal", normal_image(width, height, &rendered.normal)),
    ];
    for (kind, image) in images {
        write_png(&out.join(format!("{}-{kind}.png", view.name)), &image)?;
    }
    Ok(psnr(&rendered.color, &photo, None))
}

/// Two images of one height, the first on the left.
fn side_by_side(left: &RgbImage, right: &RgbImage) -> RgbImage {
    let mut both = RgbImage::new(left.width() + right.width(), left.height());
    imageops::replace(&mut both, left, 0, 0);
    imageops::replace(&mut both, right, i64::from(left.width()), 0);
    both
}

/// The views of these names, in the order of the scene.
fn select<'a>(views: &'a [View], names: &[String]) -> Result<Vec<&'a View>, CliError> {
    if names.is_empty() {
        return Ok(views.iter().take(1).collect());
    }
    if names.iter().any(|name| name == "all") {
        return Ok(views.iter().collect());
    }
    if let Some(name) = names
        .iter()
        .find(|name| !views.iter().any(|view| view.name == **name))
    {
        let known: Vec<&str> = views.iter().map(|view| view.name.as_str()).collect();
        return Err(CliError::UnknownView {
            view: name.clone(),
            known: known.join(", "),
        });
    }
    Ok(views
        .iter()
        .filter(|view| names.contains(&view.name))
        .collect())
}
