//! 2D wireframes of a folder of images, as files.

use super::configured_detector::ConfiguredDetector;
use super::{BYTES_PER_PIXEL, DETECTED_WITH_PIXEL_CENTER, DETECTING};
use crate::error::ImagesError;
use crate::event::{Event, OnEvent, Stage, timed};
use crate::overlay::draw_detection;
use image::RgbImage;
use neat_core::layout::{image_size, list_images, read_image};
use neat_core::{MemoryLimit, SceneError, Wireframe2d, file, hawp_json};
use neat_detect::{DetectorConfig, edge_map, segment_file, wireframe_from_segments};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What finds the line segments. Those of others go through the same fitting and
/// joining as our own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SegmentSource {
    /// The detector that the settings name.
    Configured,
    /// A file of segments for each image, `NAME.npz`, `.npy`, `.txt` or `.csv`, in
    /// this folder.
    SegmentFiles(PathBuf),
    /// An edge map for each image, `NAME.png` with bright edges, in this folder.
    EdgeMaps(PathBuf),
    /// A learned detector in an ONNX file.
    #[cfg(feature = "onnx")]
    Onnx(PathBuf),
}

/// What [`detect_folder`] shall do.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectOptions {
    /// The folder of the images.
    pub images: PathBuf,
    /// The folder for `NAME.json` of each image, and `overlays/`.
    pub out: PathBuf,
    /// What finds the segments.
    pub source: SegmentSource,
    /// Settings of fitting and joining, and of the built-in detector.
    pub config: DetectorConfig,
    /// Whether pictures of the detections are written.
    pub overlays: bool,
    /// How much memory may be used: it decides how many images are worked on at once.
    pub memory_limit: MemoryLimit,
}

/// How much was found in an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Detected {
    /// The image's name without ending.
    pub name: String,
    /// Number of junctions and free ends.
    pub vertices: usize,
    /// Number of segments.
    pub edges: usize,
}

/// Detects the 2D wireframe of every image in a folder and writes it as a HAWP
/// file, with a picture of it.
///
/// # Errors
/// If the settings are out of range, there is no image, an image or the file of its
/// segments cannot be read, or a result cannot be written.
pub fn detect_folder<R>(
    options: &DetectOptions,
    on_event: OnEvent<'_, R>,
) -> Result<Vec<Detected>, ImagesError> {
    options.config.validate()?;
    let images = list_images(&options.images)?;
    if images.is_empty() {
        return Err(SceneError::Missing {
            path: options.images.join("*.png"),
            remedy: "give a folder with PNG or JPEG images".into(),
        }
        .into());
    }
    let mut names = BTreeSet::new();
    if let Some(path) = images.iter().find(|path| !names.insert(path.file_stem())) {
        return Err(ImagesError::Scene(SceneError::Malformed {
            path: path.clone(),
            reason: "another image has this name with another ending: rename one".into(),
        }));
    }
    let sizes = images.iter().map(|path| image_size(path));
    let sizes = sizes.collect::<Result<Vec<_>, _>>()?;
    let limit = options.memory_limit;
    let bytes_each = limit.bytes_each(
        sizes.into_iter(),
        BYTES_PER_PIXEL,
        DETECTING,
        &options.images,
    )?;
    let detector = Detector::open(options)?;
    let bytes_each = bytes_each + detector.model_bytes();
    let overlays = options.out.join("overlays");
    file::create_dir(if options.overlays {
        &overlays
    } else {
        &options.out
    })?;
    timed(on_event, Stage::Detect, |on_event| {
        let mut detected = Vec::with_capacity(images.len());
        // Some at a time, so that progress can be told in between.
        for chunk in images.chunks(2 * rayon::current_num_threads()) {
            detected.extend(limit.try_map(chunk, bytes_each, |path| {
                detect_one(path, &detector, options, &overlays)
            })?);
            on_event(Event::StageProgress {
                stage: Stage::Detect,
                fraction: detected.len() as f64 / images.len() as f64,
            });
        }
        Ok(detected)
    })
}

fn detect_one(
    path: &Path,
    detector: &Detector<'_>,
    options: &DetectOptions,
    overlays: &Path,
) -> Result<Detected, SceneError> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let image = read_image(path, [0; 3])?;
    let wireframe = detector.wireframe(&name, &image, &options.config)?;
    let target = options.out.join(format!("{name}.json"));
    hawp_json::write(&target, &wireframe, DETECTED_WITH_PIXEL_CENTER)?;
    if options.overlays {
        let picture = draw_detection(&image, &wireframe);
        file::write_png(&overlays.join(format!("{name}.png")), &picture)?;
    }
    Ok(Detected {
        vertices: wireframe.vertices.len(),
        edges: wireframe.edges.len(),
        name: name.into_owned(),
    })
}

/// A [`SegmentSource`] that is ready.
enum Detector<'a> {
    Configured(Box<ConfiguredDetector<'a>>),
    SegmentFiles(&'a Path),
    EdgeMaps(&'a Path),
    #[cfg(feature = "onnx")]
    Onnx(Box<neat_detect::onnx::OnnxDetector>),
}

impl<'a> Detector<'a> {
    fn open(options: &'a DetectOptions) -> Result<Self, SceneError> {
        Ok(match &options.source {
            SegmentSource::Configured => {
                Self::Configured(Box::new(ConfiguredDetector::open(&options.config)?))
            }
            SegmentSource::SegmentFiles(dir) => Self::SegmentFiles(dir),
            SegmentSource::EdgeMaps(dir) => Self::EdgeMaps(dir),
            #[cfg(feature = "onnx")]
            SegmentSource::Onnx(path) => {
                let detector = neat_detect::onnx::OnnxDetector::load(path)?;
                Self::Onnx(Box::new(detector))
            }
        })
    }

    fn model_bytes(&self) -> u64 {
        match self {
            Self::Configured(detector) => detector.model_bytes(),
            _ => 0,
        }
    }

    fn wireframe(
        &self,
        name: &str,
        image: &RgbImage,
        config: &DetectorConfig,
    ) -> Result<Wireframe2d, SceneError> {
        let segments = match self {
            Self::Configured(detector) => return detector.wireframe(image),
            Self::SegmentFiles(dir) => segment_file::read(&file_of(dir, name))?,
            Self::EdgeMaps(dir) => {
                edge_map::segments(&edge_map::read(&dir.join(format!("{name}.png")))?)
            }
            #[cfg(feature = "onnx")]
            Self::Onnx(detector) => detector.segments(image)?,
        };
        Ok(wireframe_from_segments(image, &segments, config))
    }
}

/// The file of segments of an image: the first that there is.
fn file_of(dir: &Path, name: &str) -> PathBuf {
    let files = ["npz", "npy", "txt", "csv"].map(|ending| dir.join(format!("{name}.{ending}")));
    let found = files.iter().find(|file| file.exists());
    found.unwrap_or(&files[0]).clone()
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_core::synthetic::{SyntheticScene, generate};
    use std::fs;

    fn options(dir: &Path, source: SegmentSource) -> DetectOptions {
        DetectOptions {
            images: dir.join("images"),
            out: dir.join("out"),
            source,
            config: DetectorConfig::default(),
            overlays: true,
            memory_limit: MemoryLimit::NONE,
        }
    }

    #[test]
    fn every_source_gives_files_that_scenes_can_have() {
        let dir = tempfile::tempdir().unwrap();
        let small = SyntheticScene {
            views: 2,
            image_size: 128,
            ..SyntheticScene::default()
        };
        let scene = generate(&small).unwrap().scene;
        for folder in ["images", "segments", "edges"] {
            fs::create_dir(dir.path().join(folder)).unwrap();
        }
        for view in &scene.views {
            let path = |folder: &str, ending: &str| {
                dir.path()
                    .join(folder)
                    .join(format!("{}.{ending}", view.name))
            };
            (view.image.read().unwrap().save(path("images", "png"))).unwrap();
            let mut text = String::new();
            let mut edges = RgbImage::new(128, 128);
            for scored in view.wireframe.segments(0.05) {
                let [a, b] = scored.segment.ends().map(|end| end.add_scalar(-0.5));
                text += &format!("{} {} {} {}\n", a.x, a.y, b.x, b.y);
                for step in 0..=400 {
                    let point = a + (b - a) * (f64::from(step) / 400.0);
                    let inside = |x: f64| (0.0..127.5).contains(&x);
                    if inside(point.x) && inside(point.y) {
                        let [x, y] = [point.x, point.y].map(|x| x.round() as u32);
                        edges.put_pixel(x, y, image::Rgb([255; 3]));
                    }
                }
            }
            fs::write(path("segments", "txt"), text).unwrap();
            edges.save(path("edges", "png")).unwrap();
        }
        for source in [
            SegmentSource::Configured,
            SegmentSource::SegmentFiles(dir.path().join("segments")),
            SegmentSource::EdgeMaps(dir.path().join("edges")),
        ] {
            let options = options(dir.path(), source);
            let detected = detect_folder(&options, &mut |_: Event<'_, ()>| {}).unwrap();
            assert_eq!(detected.len(), 2);
            for one in detected {
                assert!(one.edges > 3, "{:?}: {one:?}", options.source);
                let path = options.out.join(format!("{}.json", one.name));
                let read = hawp_json::read(&path, 0.0).unwrap();
                assert_eq!(read.edges.len(), one.edges);
                let picture = options.out.join(format!("overlays/{}.png", one.name));
                assert_eq!(
                    read_image(&picture, [0; 3]).unwrap().dimensions(),
                    (128, 128)
                );
            }
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let message = |options: &DetectOptions| {
            let error = detect_folder(options, &mut |_: Event<'_, ()>| {}).unwrap_err();
            error.to_string()
        };
        let built_in = options(dir.path(), SegmentSource::Configured);
        assert!(message(&built_in).contains("images"));
        fs::create_dir(dir.path().join("images")).unwrap();
        assert!(message(&built_in).contains("PNG"));
        let image = RgbImage::new(8, 8);
        image.save(dir.path().join("images/a.png")).unwrap();
        image.save(dir.path().join("images/a.jpg")).unwrap();
        assert!(message(&built_in).contains("another image"));
        fs::remove_file(dir.path().join("images/a.jpg")).unwrap();
        let files = options(dir.path(), SegmentSource::SegmentFiles(dir.path().into()));
        assert!(message(&files).contains("a.npz"));
        let mut wrong = built_in;
        wrong.config.min_length = -1.0;
        assert!(message(&wrong).contains("min_length"));
    }
}
