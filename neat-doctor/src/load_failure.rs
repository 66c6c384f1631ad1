//! Why a scene cannot be read.

use crate::examination::{Cause, Check, Finding, Level};
use neat_core::{CameraError, SceneError, ViewError, Wireframe2dError, with_causes};
use std::path::Path;

/// The finding for a scene that cannot be read: its cause and the error's own
/// sentence, which names file, view and remedy.
pub fn explain(error: &SceneError) -> Finding {
    let message = with_causes(error);
    let (cause, what) = cause(error);
    let finding = Finding::new(Check::Files, Level::Problem, format!("{what}: {message}"));
    let finding = match error {
        SceneError::View { view, .. } | SceneError::ViewName { view, .. } => {
            finding.of_views(vec![view.clone()])
        }
        _ => finding,
    };
    finding.because(cause)
}

fn cause(error: &SceneError) -> (Cause, &'static str) {
    match error {
        SceneError::Missing { .. } => (Cause::MissingFile, "a file is missing"),
        SceneError::UnknownLayout { .. } | SceneError::NoView { .. } => {
            (Cause::MissingFile, "files are missing")
        }
        SceneError::CountMismatch { .. } => (Cause::CountMismatch, "images or poses are missing"),
        SceneError::Json { path, .. } if holds_nan(path) => (
            Cause::NotFinite,
            "a file holds NaN or infinity, which JSON has not",
        ),
        SceneError::Empty { .. }
        | SceneError::Json { .. }
        | SceneError::Malformed { .. }
        | SceneError::WrongShape { .. }
        | SceneError::Image { .. } => (Cause::DamagedFile, "a file is damaged or truncated"),
        SceneError::NotFinite { .. } => (Cause::NotFinite, "a file holds NaN or infinity"),
        SceneError::View { problem, .. } => cause_in_view(problem),
        _ => (Cause::Other, "the scene cannot be read"),
    }
}

/// Whether a JSON file has the words that Python writes for such numbers.
fn holds_nan(path: &Path) -> bool {
    std::fs::read_to_string(path)
        .is_ok_and(|text| ["NaN", "Infinity"].iter().any(|word| text.contains(word)))
}

fn cause_in_view(problem: &ViewError) -> (Cause, &'static str) {
    match problem {
        ViewError::Camera(CameraError::NotFinite) => {
            (Cause::NotFinite, "a camera holds NaN or infinity")
        }
        ViewError::Wireframe(Wireframe2dError::NotFinite { .. }) => {
            (Cause::NotFinite, "a wireframe holds NaN or infinity")
        }
        ViewError::Camera(CameraError::Mirrored { .. }) => {
            (Cause::MirroredPoses, "a pose is mirrored")
        }
        ViewError::Camera(CameraError::Singular { .. } | CameraError::NotRigid { .. }) => {
            (Cause::NotRigid, "a pose is no rotation and translation")
        }
        ViewError::Camera(CameraError::FocalLength { .. } | CameraError::Intrinsics) => {
            (Cause::FocalLength, "intrinsics are wrong")
        }
        ViewError::ImageSize { .. } => (
            Cause::ResizedImages,
            "an image has another size than its camera or wireframe is for",
        ),
        _ => (Cause::Other, "a view cannot be used"),
    }
}

/// The factor by which an image was scaled, if its camera is for one of the same
/// shape.
pub(crate) fn size_factor(error: &SceneError) -> Option<f64> {
    let SceneError::View {
        problem:
            ViewError::ImageSize {
                what: "camera",
                expected_width,
                expected_height,
                width,
                height,
            },
        ..
    } = error
    else {
        return None;
    };
    let [expected_width, expected_height, width, height] =
        [*expected_width, *expected_height, *width, *height].map(f64::from);
    let scale = width / expected_width;
    // Half a pixel, by which scaled sizes are rounded.
    let same_shape = (scale * expected_height - height).abs() <= 0.5 + 0.5 * scale;
    same_shape.then_some(scale)
}
