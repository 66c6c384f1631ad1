//! What can go wrong in a run as a whole.

use crate::distill::DistillError;
use crate::overrides::OverrideError;
use crate::run_dir::RunDirError;
use crate::trainer::TrainError;
use neat_core::SceneError;
use neat_core::synthetic::SyntheticError;
use neat_eval::EvalError;
use neat_report::ReportError;
use neat_tensor::BackendError;
use neat_tensor::checkpoint::CheckpointError;
use neat_wireframe::export::ExportError;
use std::error::Error;
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
    /// A synthetic scene would mix with what is there.
    #[error("{0} is not empty: choose another folder for the synthetic scene")]
    SceneDirNotEmpty(PathBuf),
    /// A synthetic scene cannot be made as asked for.
    #[error(transparent)]
    Synthetic(#[from] SyntheticError),
    /// The settings of the detector are out of range.
    #[error("the section `detect` of the configuration: {0}")]
    Detector(#[from] neat_detect::DetectorConfigError),
    /// The scene would be lost time: what stands against it, line by line.
    #[error(
        "the scene is not fit for a run:\n{0}\n`neat doctor` explains it; --no-doctor runs it nevertheless"
    )]
    NotReady(String),
    /// A change of the configuration does not apply.
    #[error(transparent)]
    Override(OverrideError),
    /// The optimisation failed.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// No wireframe could be taken out of the field.
    #[error(transparent)]
    Distill(#[from] DistillError),
    /// A result could not be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The report could not be made.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A result could not be measured.
    #[error(transparent)]
    Evaluation(#[from] EvalError),
    /// A person stopped the run.
    #[error("interrupted after step {step}: {checkpoint} holds the state")]
    Interrupted {
        /// Steps that are done.
        step: u64,
        /// The checkpoint that was written.
        checkpoint: PathBuf,
    },
    /// A person stopped an ablation.
    #[error("interrupted: {done} of {all} variants are done")]
    AblationInterrupted {
        /// So many variants have a row in the table …
        done: usize,
        /// … of so many.
        all: usize,
    },
    /// The folder of an ablation holds something else.
    #[error("{out} holds {what}: choose another folder, or remove it")]
    OtherAblation {
        /// The folder.
        out: PathBuf,
        /// What is in it.
        what: String,
    },
}

impl PipelineError {
    /// Whether the cause lies in what was asked for or in the input, and trying
    /// again without a change is pointless; otherwise the run itself failed.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Scene(error) => !is_write_error(error),
            Self::RunDir(RunDirError::File(error)) => !is_write_error(error),
            Self::RunDir(
                RunDirError::Serialize(_) | RunDirError::Checkpoint(CheckpointError::Io { .. }),
            ) => false,
            Self::RunDir(_)
            | Self::Backend(_)
            | Self::SceneDirNotEmpty(_)
            | Self::Synthetic(_)
            | Self::Evaluation(_)
            | Self::Detector(_)
            | Self::Override(_)
            | Self::OtherAblation { .. }
            | Self::NotReady(_) => true,
            Self::Train(error) => matches!(
                error,
                TrainError::Config(_)
                    | TrainError::NoRegionPixel(_)
                    | TrainError::Parameters(_)
                    | TrainError::Checkpoint(_)
            ),
            Self::Distill(_)
            | Self::Export(_)
            | Self::Report(_)
            | Self::Interrupted { .. }
            | Self::AblationInterrupted { .. } => false,
        }
    }
}

/// The message of an error and what caused it, in one sentence.
pub fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let message = error.to_string();
        // Some libraries repeat their cause in their own message.
        if !text.contains(&message) {
            text.push_str(" (");
            text.push_str(&message);
            text.push(')');
        }
        cause = error.source();
    }
    text
}

fn is_write_error(error: &SceneError) -> bool {
    matches!(
        error,
        SceneError::Write { .. } | SceneError::ImageStore { .. }
    )
}
