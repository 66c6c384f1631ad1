//! What can go wrong in a run as a whole.

use crate::distill::DistillError;
use crate::event::Stage;
use crate::plan::PlanError;
use crate::run_dir::RunDirError;
use neat_core::SceneError;
use neat_images::error::ImagesError;
use neat_report::ReportError;
use neat_stereo::StereoError;
use neat_tensor::BackendError;
use neat_tensor::checkpoint::CheckpointError;
use neat_train::TrainError;
use neat_wireframe::export::ExportError;
use std::io::ErrorKind;
use std::path::PathBuf;

/// Why a run did not finish.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The scene, or another file, could not be read or written.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The run folder cannot be used.
    #[error(transparent)]
    RunDir(#[from] RunDirError),
    /// The backend cannot be used.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The settings of the detector are out of range.
    #[error("the section `detect` of the configuration: {0}")]
    Detector(#[from] neat_detect::DetectorConfigError),
    /// The scene would be lost time: what stands against it, line by line.
    #[error(
        "the scene is not fit for a run:\n{0}\n`neat doctor` explains it; --no-doctor runs it nevertheless"
    )]
    NotReady(String),
    /// A run would continue with other inputs or another configuration.
    #[error(
        "{dir} holds a run that began otherwise:\n  {differences}\nrestore that, or begin anew with --overwrite or in another folder"
    )]
    Changed {
        /// The folder of the run.
        dir: PathBuf,
        /// One per line.
        differences: String,
    },
    /// The optimisation failed.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// No wireframe could be taken out of the field.
    #[error(transparent)]
    Distill(DistillError),
    /// A result could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The report could not be made.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A person, or the system, stopped the run during its training.
    #[error("interrupted after step {step}: {checkpoint} holds the state")]
    Interrupted {
        /// Steps that are done.
        step: u64,
        /// The checkpoint that was written.
        checkpoint: PathBuf,
    },
    /// A person, or the system, stopped the run in another stage, which will be
    /// repeated.
    #[error("interrupted ({0}): what was done before is on disk")]
    InterruptedIn(Stage),
    /// The optimisation failed again and again.
    #[error(
        "{source}; {tries} tries with lower learning rates did not help: {dump} holds the state before it; look at train.learning_rate and at the scene's poses"
    )]
    Diverged {
        /// So often the last good checkpoint was restored.
        tries: usize,
        /// The folder of a run that shows the failure again.
        dump: PathBuf,
        /// The last failure.
        source: Box<TrainError>,
    },
    /// The device failed, and so did all that it could be replaced by.
    #[error(
        "the device failed ({reason}): try --backend flex, a smaller train.ray_chunk, or --resume after other programs have released its memory"
    )]
    DeviceFailed {
        /// What the backend said.
        reason: String,
    },
}

impl From<ImagesError> for PipelineError {
    fn from(error: ImagesError) -> Self {
        match error {
            ImagesError::Scene(error) => Self::Scene(error),
            ImagesError::Detector(error) => Self::Detector(error),
            ImagesError::NotReady(problems) => Self::NotReady(problems),
            ImagesError::InterruptedIn(stage) => Self::InterruptedIn(stage),
        }
    }
}

impl From<PlanError> for PipelineError {
    fn from(error: PlanError) -> Self {
        match error {
            PlanError::Scene(error) => Self::Scene(error),
            PlanError::Config(error) => Self::Train(error),
            PlanError::Detector(error) => Self::Detector(error),
            PlanError::Open(_) | PlanError::NoField(_) | PlanError::NoFieldForPartners => {
                Self::Train(TrainError::Config(error.to_string()))
            }
        }
    }
}

impl From<StereoError> for PipelineError {
    fn from(error: StereoError) -> Self {
        match error {
            StereoError::Interrupted => Self::InterruptedIn(Stage::Match),
            StereoError::Scene(error) => Self::Scene(error),
        }
    }
}

impl From<DistillError> for PipelineError {
    fn from(error: DistillError) -> Self {
        match error {
            DistillError::Cancelled(_) => Self::InterruptedIn(Stage::Distill),
            DistillError::Image(error) => Self::Scene(error),
            error => Self::Distill(error),
        }
    }
}

impl PipelineError {
    /// Whether the cause lies in what was asked for or in the input, and trying
    /// again without a change is pointless; otherwise the run itself failed.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Scene(error) => error.is_bad_input(),
            Self::RunDir(RunDirError::File(error)) => error.is_bad_input(),
            Self::RunDir(RunDirError::Serialize(_) | RunDirError::InUse(_)) => false,
            // A folder that may not be written is a wrong choice, a full disk is not.
            Self::RunDir(RunDirError::Unwritable { source, .. }) => !is_full_disk(source),
            Self::RunDir(RunDirError::Checkpoint(CheckpointError::File(error))) => {
                error.is_bad_input()
            }
            Self::RunDir(_)
            | Self::Backend(_)
            | Self::Detector(_)
            | Self::Changed { .. }
            | Self::NotReady(_) => true,
            Self::Train(error) => matches!(
                error,
                TrainError::Config(_)
                    | TrainError::Network(_)
                    | TrainError::NoRegionPixel(_)
                    | TrainError::Parameters(_)
                    | TrainError::Checkpoint(_)
            ),
            Self::Distill(_)
            | Self::Export(_)
            | Self::Report(_)
            | Self::Interrupted { .. }
            | Self::InterruptedIn(_)
            | Self::Diverged { .. }
            | Self::DeviceFailed { .. } => false,
        }
    }
}

fn is_full_disk(error: &SceneError) -> bool {
    let full = [
        ErrorKind::StorageFull,
        ErrorKind::QuotaExceeded,
        ErrorKind::FileTooLarge,
    ];
    matches!(error, SceneError::Write { source, .. } if full.contains(&source.kind()))
}
