//! What can go wrong before there is a wireframe.

use crate::event::Stage;
use neat_core::SceneError;
use neat_detect::DetectorConfigError;

/// Why a scene could not be made ready.
#[derive(Debug, thiserror::Error)]
pub enum ImagesError {
    /// The scene, or another file, could not be read or written.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The settings of the detector are out of range.
    #[error("the section `detect` of the configuration: {0}")]
    Detector(#[from] DetectorConfigError),
    /// The scene would be lost time: what stands against it, line by line.
    #[error("the scene is not fit for a run:\n{0}")]
    NotReady(String),
    /// Nobody wants it any more.
    #[error("interrupted ({0})")]
    InterruptedIn(Stage),
}
