//! What can go wrong in a measurement.

use neat_core::SceneError;
use neat_core::synthetic::SyntheticError;
use neat_eval::EvalError;
use neat_pipeline::config::OverrideError;
use neat_pipeline::error::PipelineError;
use neat_pipeline::plan::PlanError;
use neat_pipeline::run_dir::RunDirError;
use neat_train::TrainError;
use neat_wireframe::export::ExportError;
use std::path::PathBuf;

/// Why a measurement did not finish.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// A run did not finish.
    #[error(transparent)]
    Pipeline(PipelineError),
    /// A synthetic scene would mix with what is there.
    #[error("{0} is not empty: choose another folder for the synthetic scene")]
    SceneDirNotEmpty(PathBuf),
    /// A synthetic scene cannot be made as asked for.
    #[error(transparent)]
    Synthetic(#[from] SyntheticError),
    /// A change of the configuration does not apply.
    #[error(transparent)]
    Override(#[from] OverrideError),
    /// A result could not be measured.
    #[error(transparent)]
    Evaluation(#[from] EvalError),
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

/// Everything that a pipeline error can be made of.
macro_rules! through_pipeline {
    ($($error:ty),+) => {
        $(impl From<$error> for LabError {
            fn from(error: $error) -> Self {
                Self::Pipeline(error.into())
            }
        })+
    };
}
through_pipeline!(
    PipelineError,
    SceneError,
    RunDirError,
    PlanError,
    TrainError,
    ExportError
);

impl LabError {
    /// Whether the cause lies in what was asked for or in the input, and trying
    /// again without a change is pointless.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Pipeline(error) => error.is_bad_input(),
            Self::AblationInterrupted { .. } => false,
            _ => true,
        }
    }
}
