//! What can be wrong with a scene on disk, and what to do about it.

use crate::camera::CameraError;
use crate::wireframe2d::Wireframe2dError;
use std::error::Error;
use std::io::ErrorKind;
use std::iter::successors;
use std::path::{Path, PathBuf};

/// What Unix says for an error of the device, and for too many open files of the system and of
/// the process: EIO, ENFILE, EMFILE.
#[cfg(unix)]
const LACKING: [i32; 3] = [5, 23, 24];
/// What Windows says for too many open files.
#[cfg(not(unix))]
const LACKING: [i32; 1] = [4];

/// Why a file or a folder of a scene could not be read or written.
///
/// Every message names the file, the view where there is one, and the remedy.
/// Causes that come from other crates are in [`std::error::Error::source`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A file or folder that must be there is not.
    #[error("{path} does not exist: {remedy}")]
    Missing {
        /// The file or folder looked for.
        path: PathBuf,
        /// How to provide it.
        remedy: String,
    },
    /// A file where a folder must be.
    #[error("{path} is a file, not a folder: {remedy}")]
    NotAFolder {
        /// The file.
        path: PathBuf,
        /// What folder is meant.
        remedy: String,
    },
    /// A file of zero bytes.
    #[error("{path} is empty: write or download it again")]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A file beyond what its format can sensibly need.
    #[error("{path} has more than {limit} bytes: is it the right file?")]
    TooLarge {
        /// The file, or the array in it.
        path: PathBuf,
        /// The largest size that is read.
        limit: u64,
    },
    /// The operating system refused to read.
    #[error("cannot read {path}: check the file and its permissions")]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The operating system refused to write.
    #[error("cannot write {path}: check the permissions of its folder and the space on the disk")]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A folder to be written that has files already.
    #[error("{path} is a file or has files in it: give a new or an empty folder")]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// A view that a format has no words for.
    #[error("view `{view}` cannot be written to {path}: {reason}")]
    Inexpressible {
        /// The file to be written.
        path: PathBuf,
        /// Name of the view.
        view: String,
        /// What is missing in the format, and the remedy.
        reason: String,
    },
    /// JSON that does not follow its grammar or lacks a field.
    #[error("{path} is not a valid {format}: it may be truncated; write it again")]
    Json {
        /// The file.
        path: PathBuf,
        /// What it should be, such as "HAWP wireframe".
        format: &'static str,
        /// Where and why parsing stopped.
        source: serde_json::Error,
    },
    /// A file that breaks the rules of its format.
    #[error("{path} cannot be understood: {reason}; write it again")]
    Malformed {
        /// The file, or the array in it.
        path: PathBuf,
        /// Which rule it breaks.
        reason: String,
    },
    /// NaN or an infinite number where only numbers make sense.
    #[error("{path} cannot be used: {element} is {value}; write it again")]
    NotFinite {
        /// The file, or the array in it.
        path: PathBuf,
        /// Which one.
        element: String,
        /// What it is instead of a number.
        value: f64,
    },
    /// An array of another shape than its layout asks for.
    #[error("array `{array}` of {path} has shape {found:?}, expected {expected}")]
    WrongShape {
        /// The archive.
        path: PathBuf,
        /// Name of the array.
        array: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape the layout asks for, in words.
        expected: &'static str,
    },
    /// An image that cannot be decoded or encoded.
    #[error("image {path} cannot be read or written: replace it by a valid PNG or JPEG")]
    Image {
        /// The image.
        path: PathBuf,
        /// What the codec said.
        source: image::ImageError,
    },
    /// The temporary file that images lie in where memory is limited.
    #[error(
        "the image of view `{view}` cannot be kept in a temporary file in {dir}, or read back: check the space on that disk, give another folder for the cache, or allow more memory"
    )]
    ImageStore {
        /// Name of the view.
        view: String,
        /// The folder of the file.
        dir: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Less memory than work on a single image takes.
    #[error(
        "{work} of {path} takes {needed_mib} MiB for {width}×{height} pixels, more than the memory limit of {limit_mib} MiB: allow more with --memory-limit, or scale images down with --max-image-size"
    )]
    MemoryLimit {
        /// The image, or the scene that it belongs to.
        path: PathBuf,
        /// What is done with the image.
        work: &'static str,
        /// Width of the largest image.
        width: u32,
        /// Its height.
        height: u32,
        /// Mebibytes that it takes.
        needed_mib: u64,
        /// Mebibytes that there are.
        limit_mib: u64,
    },
    /// A view that makes no sense.
    #[error("view `{view}` of {path}: {problem}")]
    View {
        /// The file that says so.
        path: PathBuf,
        /// Name of the view.
        view: String,
        /// What is wrong with it.
        problem: ViewError,
    },
    /// A camera of a model that cannot be turned into a pinhole here.
    #[error(
        "{path}: camera {camera} has the model {model}, which is not read: run `colmap image_undistorter` and give its images and model"
    )]
    NotPinhole {
        /// The file with the camera.
        path: PathBuf,
        /// Its number in that file.
        camera: u32,
        /// Name of its model.
        model: String,
    },
    /// Files and poses that do not belong together.
    #[error(
        "{path} holds {poses} poses, but {images_dir} holds {images} images: add or remove images so that their sorted names match the poses"
    )]
    CountMismatch {
        /// The file with the poses.
        path: PathBuf,
        /// How many poses it holds.
        poses: usize,
        /// The folder of the images.
        images_dir: PathBuf,
        /// How many images it holds.
        images: usize,
    },
    /// Two views of one name, or a name that cannot be a file name.
    #[error("{path}: view name `{view}` {reason}")]
    ViewName {
        /// The scene.
        path: PathBuf,
        /// The name.
        view: String,
        /// Why it cannot stay.
        reason: &'static str,
    },
    /// A scene without views.
    #[error("{path} holds no view: a scene needs images and their poses")]
    NoView {
        /// The scene.
        path: PathBuf,
    },
    /// Not one view has a segment.
    #[error(
        "none of the {views} views of {path} has a segment with a score above {min_segment_score}: detect 2D wireframes again or lower the minimum score"
    )]
    NoUsableView {
        /// The scene.
        path: PathBuf,
        /// How many views it has.
        views: usize,
        /// The minimum score.
        min_segment_score: f64,
    },
    /// A scene sphere that cannot be placed as asked for.
    #[error(
        "the scene sphere of {path} cannot be placed: there is {evidence}; choose another with --scene-sphere, such as cameras, points, or x,y,z,radius"
    )]
    NoSphere {
        /// The scene.
        path: PathBuf,
        /// What it lacks.
        evidence: &'static str,
    },
    /// A folder that follows none of the known layouts.
    #[error(
        "{path} is not a scene: expected cameras.npz with `intrinsics` and `extrinsics`, cameras.npz or cameras_sphere.npz with `world_mat_0` and `scale_mat_0`, cameras.json, transforms.json, a COLMAP model (cameras and images, .bin or .txt) in sparse/0, sparse or the folder itself, meta_data.json, sfm_data.json (OpenMVG), scene.mvs (OpenMVS), a .nvm file (VisualSfM), bundle.out with list.txt (Bundler), or NAME.jpg.camera files (Strecha)"
    )]
    UnknownLayout {
        /// The folder.
        path: PathBuf,
    },
}

impl SceneError {
    /// Whether the files are to blame; otherwise it is the system, which may do better at the
    /// next try: it cannot write, or has no memory or file handles left.
    pub fn is_bad_input(&self) -> bool {
        let source = match self {
            Self::Write { .. } | Self::ImageStore { .. } => return false,
            Self::Read { source, .. } => source,
            Self::Image {
                source: image::ImageError::IoError(source),
                ..
            } => source,
            _ => return true,
        };
        !(source.kind() == ErrorKind::OutOfMemory
            || (source.raw_os_error()).is_some_and(|code| LACKING.contains(&code)))
    }

    /// A file that breaks the rules of its format.
    pub fn malformed(path: &Path, reason: impl Into<String>) -> Self {
        Self::Malformed {
            path: path.into(),
            reason: reason.into(),
        }
    }

    /// A file or folder that is not there; `remedy` says how to provide it.
    pub fn missing(path: &Path, remedy: impl Into<String>) -> Self {
        Self::Missing {
            path: path.into(),
            remedy: remedy.into(),
        }
    }

    /// A problem of the view called `view`, with the file that says so.
    pub fn view(path: &Path, view: &str, problem: impl Into<ViewError>) -> Self {
        Self::View {
            path: path.into(),
            view: view.into(),
            problem: problem.into(),
        }
    }

    /// What a codec said about an image.
    pub(crate) fn image(path: &Path, source: image::ImageError) -> Self {
        Self::Image {
            path: path.into(),
            source,
        }
    }

    /// What the system said when it refused to write.
    pub(crate) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Write {
            path: path.into(),
            source,
        }
    }
}

/// The message of an error, and in brackets those of what caused it: one line.
///
/// ```
/// let error = neat_core::load_scene("/nowhere", &Default::default()).unwrap_err();
/// assert!(neat_core::with_causes(&error).contains("/nowhere does not exist"));
/// ```
pub fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    for cause in successors(error.source(), |&cause| cause.source()) {
        let message = cause.to_string();
        // Some libraries repeat their cause in their own message.
        if !text.contains(&message) {
            text += &format!(" ({message})");
        }
    }
    text
}

/// What can be wrong with one view.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum ViewError {
    /// Its camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Its 2D wireframe.
    #[error(transparent)]
    Wireframe(#[from] Wireframe2dError),
    /// A lens that shows no whole image of a pinhole.
    #[error(
        "its lens of model {lens} cannot be undistorted: check the order and the signs of its coefficients and its principal point"
    )]
    Lens {
        /// Name of the model.
        lens: &'static str,
    },
    /// Its image differs in size from what describes it.
    #[error(
        "the {what} is for {expected_width}×{expected_height} pixels, but the image has {width}×{height}: make the {what} from this very image"
    )]
    ImageSize {
        /// What disagrees with the image: its camera or its wireframe.
        what: &'static str,
        /// Width according to it.
        expected_width: u32,
        /// Height according to it.
        expected_height: u32,
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
    },
}
