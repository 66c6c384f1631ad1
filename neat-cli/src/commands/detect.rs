//! `neat detect`.

use crate::arguments::{Detector, check_overrides};
use crate::error::CliError;
use crate::memory::MemoryArgs;
use crate::output;
use crate::progress::Progress;
use clap::Args;
use neat_pipeline::config::{Preset, apply_overrides};
use neat_pipeline::detection::{DetectOptions, SegmentSource, detect_folder};
use neat_pipeline::error::PipelineError;
use std::path::PathBuf;

/// Detect the 2D wireframe of every image in a folder
///
/// OUT then holds NAME.json for each image, in the format of HAWP, and overlays/. As the folder
/// hawp/ of a scene these files are what `neat reconstruct` reads. It detects by itself where a
/// scene has none, so this command is for looking, for other settings, and for the segments of
/// other detectors, which are fitted to the images and joined to a graph like our own.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat detect SCENE/images --out SCENE/hawp
  neat detect PHOTOS --out OUT --set min_length=12 --set texture_factor=8
  neat detect PHOTOS --out OUT --segments DEEPLSD        NAME.npz, .npy, .txt or .csv per image
  neat detect PHOTOS --out OUT --edges MAPS              NAME.png per image, bright edges

Lengths are in pixels of an image of 512 by 512 and follow the size of yours; a wrong key of
--set lists the right ones.")]
pub struct DetectArgs {
    /// Folder of the images
    #[arg(value_name = "IMAGES")]
    images: PathBuf,
    /// Folder for the results; files of the same names are replaced
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
    /// What finds the segments, the same as --set detector=NAME
    #[arg(long, value_name = "NAME", group = "source")]
    detector: Option<Detector>,
    /// Take the segments of another detector (LSD, DeepLSD, ScaleLSD, LIMAP) from files in this
    /// folder
    #[arg(long, value_name = "DIR", group = "source")]
    segments: Option<PathBuf>,
    /// Take the segments from edge maps in this folder
    #[arg(long, value_name = "DIR", group = "source")]
    edges: Option<PathBuf>,
    /// Take the segments of a learned detector in an ONNX file
    #[cfg(feature = "onnx")]
    #[arg(long, value_name = "FILE", group = "source")]
    model: Option<PathBuf>,
    /// Change one setting of the detector, such as min_length=12; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Write no pictures
    #[arg(long)]
    no_overlays: bool,
    #[command(flatten)]
    memory: MemoryArgs,
}

impl DetectArgs {
    pub fn run(self, quiet: bool) -> Result<(), CliError> {
        let settings: Vec<String> = (self.set.iter())
            // As in a run's configuration, or without its section.
            .map(|set| format!("detect.{}", set.strip_prefix("detect.").unwrap_or(set)))
            .collect();
        let mut config = apply_overrides(&Preset::default().config(), &settings)?;
        if let Some(detector) = self.detector {
            config.detect.detector = detector.into();
            check_overrides(&config, &settings, &detector.option())?;
        }
        #[cfg(feature = "onnx")]
        let learned = self.model.map(SegmentSource::Onnx);
        #[cfg(not(feature = "onnx"))]
        let learned = None;
        let source = learned
            .or(self.segments.map(SegmentSource::SegmentFiles))
            .or(self.edges.map(SegmentSource::EdgeMaps))
            .unwrap_or(SegmentSource::Configured);
        let options = DetectOptions {
            images: self.images,
            out: self.out,
            source,
            config: config.detect,
            overlays: !self.no_overlays,
            memory_limit: self.memory.limit(),
        };
        let mut progress = Progress::new(quiet);
        let detected = detect_folder(&options, &mut |event| progress.show(event))
            .map_err(PipelineError::from)?;
        drop(progress);
        let mut edges: Vec<usize> = detected.iter().map(|one| one.edges).collect();
        edges.sort_unstable();
        output::print(&format!(
            "{} images, {} to {} segments, median {}: {}",
            detected.len(),
            edges[0],
            edges[edges.len() - 1],
            edges[edges.len() / 2],
            options.out.display()
        ))
    }
}
