//! Ways to spoil a good scene on disk, each with the cause that has to be named.

use image::RgbImage;
use nalgebra::{Matrix3, Matrix4, Rotation3, Vector4};
use neat_core::layout::CameraAxes;
use neat_core::npz::{NpyArray, write_npz};
use neat_core::{LoadOptions, Scene};
use neat_doctor::{Cause, Examination, Level};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Reads scenes without asking for 2D wireframes.
pub fn load_options() -> LoadOptions {
    LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    }
}

/// A good scene and where its images are.
pub struct Base {
    pub scene: Scene,
    /// In the order of the views.
    pub images: Vec<PathBuf>,
}

impl Base {
    /// Of a scene that was read from the folder `dir`.
    pub fn new(scene: Scene, dir: &Path) -> Self {
        let find = |name: &String| {
            let folders = ["images", "image"].into_iter();
            let paths = folders.flat_map(|folder| {
                let endings = ["png", "jpg", "jpeg"].into_iter();
                endings.map(move |ending| dir.join(folder).join(format!("{name}.{ending}")))
            });
            paths.into_iter().find(|path| path.exists())
        };
        let images = (scene.views.iter())
            .map(|view| find(&view.name).expect("the image of every view"))
            .collect();
        Self { scene, images }
    }
}

/// One way to spoil a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corruption {
    InvertedPoses,
    OpenGlAxes,
    SwappedAxes,
    LongFocal,
    ShortFocal,
    HalfSizeImages,
    OneBadPose,
    MissingImage,
    TruncatedCameras,
    TruncatedImage,
    NanInPose,
    MirroredWorld,
    MirroredImages,
    ShuffledImages,
}

impl Corruption {
    pub const ALL: [Self; 14] = [
        Self::InvertedPoses,
        Self::OpenGlAxes,
        Self::SwappedAxes,
        Self::LongFocal,
        Self::ShortFocal,
        Self::HalfSizeImages,
        Self::OneBadPose,
        Self::MissingImage,
        Self::TruncatedCameras,
        Self::TruncatedImage,
        Self::NanInPose,
        Self::MirroredWorld,
        Self::MirroredImages,
        Self::ShuffledImages,
    ];

    #[allow(dead_code, reason = "the example prints it, the tests do not")]
    pub fn name(self) -> &'static str {
        match self {
            Self::InvertedPoses => "inverted poses",
            Self::OpenGlAxes => "OpenGL axes read as OpenCV",
            Self::SwappedAxes => "camera axes y and z swapped",
            Self::LongFocal => "focal length × 1.3",
            Self::ShortFocal => "focal length × 0.5",
            Self::HalfSizeImages => "images of half size",
            Self::OneBadPose => "one bad pose",
            Self::MissingImage => "a missing image",
            Self::TruncatedCameras => "`cameras.npz` truncated",
            Self::TruncatedImage => "an image truncated",
            Self::NanInPose => "NaN in a pose",
            Self::MirroredWorld => "mirrored world",
            Self::MirroredImages => "mirrored images",
            Self::ShuffledImages => "shuffled image order",
        }
    }

    /// The cause that has to be named.
    pub fn cause(self) -> Cause {
        match self {
            Self::InvertedPoses => Cause::InvertedPoses,
            Self::OpenGlAxes | Self::SwappedAxes => Cause::CameraAxes,
            Self::LongFocal | Self::ShortFocal => Cause::FocalLength,
            Self::HalfSizeImages => Cause::ResizedImages,
            Self::OneBadPose => Cause::BadPose,
            Self::MissingImage => Cause::CountMismatch,
            Self::TruncatedCameras | Self::TruncatedImage => Cause::DamagedFile,
            Self::NanInPose => Cause::NotFinite,
            Self::MirroredWorld | Self::MirroredImages => Cause::MirroredPoses,
            Self::ShuffledImages => Cause::ImageOrder,
        }
    }

    /// What repairs it, where flags can.
    pub fn flags(self) -> Option<&'static str> {
        match self {
            Self::InvertedPoses => Some("--poses world-to-camera"),
            Self::OpenGlAxes => Some("--camera-axes right-up-back"),
            Self::SwappedAxes => Some("--camera-axes right-forward-up"),
            Self::HalfSizeImages => Some("--intrinsics-scale 0.5"),
            Self::MirroredWorld => Some("--mirrored-world"),
            Self::MirroredImages => Some("--camera-axes left-down-forward --mirrored-world"),
            _ => None,
        }
    }

    /// The base scene, spoilt, in the layout of `cameras.npz`.
    pub fn write(self, base: &Base) -> TempDir {
        let dir = tempfile::tempdir().unwrap();
        let images_dir = dir.path().join("images");
        fs::create_dir(&images_dir).unwrap();
        let count = base.scene.views.len();
        for (view, image) in base.images.iter().enumerate() {
            let named = match self {
                // A permutation without system: 7 shares no factor with most counts.
                Self::ShuffledImages => shuffled(count)[view],
                _ => view,
            };
            let ending = image.extension().unwrap().to_str().unwrap();
            let target = images_dir.join(format!("{}.{ending}", base.scene.views[named].name));
            let pixels = &*base.scene.views[view].image.read().unwrap();
            match self {
                Self::HalfSizeImages => half(pixels).save(target.with_extension("png")).unwrap(),
                Self::MirroredImages => image::imageops::flip_horizontal(pixels)
                    .save(target.with_extension("png"))
                    .unwrap(),
                Self::MissingImage if view == count / 2 => {}
                Self::TruncatedImage if view == count / 2 => {
                    let bytes = fs::read(image).unwrap();
                    fs::write(target, &bytes[..bytes.len() / 2]).unwrap();
                }
                _ => {
                    fs::copy(image, target).unwrap();
                }
            }
        }
        let npz = dir.path().join("cameras.npz");
        self.write_cameras(base, &npz);
        if self == Self::TruncatedCameras {
            let bytes = fs::read(&npz).unwrap();
            fs::write(&npz, &bytes[..bytes.len() * 6 / 10]).unwrap();
        }
        dir
    }

    fn write_cameras(self, base: &Base, path: &Path) {
        let (mut poses, mut intrinsics) = (Vec::new(), Vec::new());
        let count = base.scene.views.len();
        for (index, view) in base.scene.views.iter().enumerate() {
            let mut pose = view.camera.matrix_world_from_camera();
            let mut k = view.camera.intrinsics.matrix();
            self.spoil(index, count, &mut pose, &mut k);
            // Row by row: nalgebra stores columns.
            poses.extend_from_slice(pose.transpose().as_slice());
            intrinsics.extend_from_slice(k.transpose().as_slice());
        }
        let array = |side: usize, values| NpyArray {
            shape: vec![count, side, side],
            values,
        };
        let arrays = BTreeMap::from([
            ("extrinsics", array(4, poses)),
            ("intrinsics", array(3, intrinsics)),
        ]);
        write_npz(path, &arrays).unwrap();
    }

    fn spoil(self, view: usize, count: usize, pose: &mut Matrix4<f64>, k: &mut Matrix3<f64>) {
        let in_axes = |pose: &Matrix4<f64>, axes: &str| {
            let axes: CameraAxes = axes.parse().unwrap();
            pose * axes.opencv_from_camera().to_homogeneous()
        };
        match self {
            Self::InvertedPoses => *pose = pose.try_inverse().unwrap(),
            Self::OpenGlAxes => *pose = in_axes(pose, "right-up-back"),
            Self::SwappedAxes => *pose = in_axes(pose, "right-forward-up"),
            Self::LongFocal | Self::ShortFocal => {
                let factor = if self == Self::LongFocal { 1.3 } else { 0.5 };
                k[(0, 0)] *= factor;
                k[(1, 1)] *= factor;
            }
            Self::OneBadPose if view == count / 3 => {
                let turn = Rotation3::from_euler_angles(0.1, -0.2, 0.15);
                *pose *= turn.to_homogeneous();
            }
            Self::NanInPose if view == count / 3 => pose[(1, 2)] = f64::NAN,
            Self::MirroredWorld => {
                *pose = Matrix4::from_diagonal(&Vector4::new(1.0, 1.0, -1.0, 1.0)) * *pose;
            }
            _ => {}
        }
    }
}

/// A fixed permutation that is no shift: views trade places at random.
fn shuffled(count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    let mut state = 12345u64;
    for i in (1..count).rev() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        order.swap(i, (state >> 33) as usize % (i + 1));
    }
    order
}

/// Every second pixel's square averaged.
fn half(image: &RgbImage) -> RgbImage {
    let (width, height) = (image.width() / 2, image.height() / 2);
    image::imageops::resize(image, width, height, image::imageops::FilterType::Triangle)
}

/// The first problem and whether it names the right cause and repair.
pub fn judged(corruption: Corruption, examination: &Examination) -> Result<(), String> {
    let Some(problem) = examination.problems().next() else {
        return Err(format!("no problem found:\n{examination}"));
    };
    assert_eq!(problem.level, Level::Problem);
    if problem.cause != Some(corruption.cause()) {
        return Err(format!("another cause:\n{problem}"));
    }
    let flags = problem.repair.map(|repair| repair.to_string());
    match corruption.flags() {
        Some(expected) if flags.as_deref() != Some(expected) => {
            Err(format!("other flags: {flags:?}"))
        }
        _ => Ok(()),
    }
}
