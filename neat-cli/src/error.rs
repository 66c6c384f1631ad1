//! What ends a command early, and the exit code that tells scripts.

use neat_batch::BatchError;
use neat_core::SceneError;
use neat_eval::EvalError;
use neat_lab::LabError;
use neat_lab::compare_backends::CompareError;
use neat_pipeline::config::OverrideError;
use neat_pipeline::error::PipelineError;
use neat_pipeline::plan::PlanError;
use neat_pipeline::run_dir::RunDirError;
use neat_tensor::BackendError;
use neat_train::TrainError;

/// Exit code of a run that failed.
const FAILED: u8 = 1;
/// Exit code of arguments or input that cannot be used; clap uses it too.
const BAD_INPUT: u8 = 2;
/// Exit code of a run that is done, with a wireframe that is empty.
const EMPTY: u8 = 3;
/// Exit code after Ctrl-C, by the convention of shells: 128 + SIGINT.
pub const INTERRUPTED: u8 = 130;

/// Why a command did not do what was asked for.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// A run did not finish.
    #[error(transparent)]
    Pipeline(PipelineError),
    /// A person stopped a run that `--resume` continues.
    #[error("{0}")]
    Resumable(PipelineError),
    /// A run that came to its end, and found nothing.
    #[error("the wireframe is empty; all results are written: look at {report}")]
    NoEdges {
        /// The report.
        report: String,
    },
    /// Variants of an ablation that could not be measured.
    #[error("{failed} of {all} variants failed: the column `note` of the table says why")]
    VariantsFailed {
        /// So many failed …
        failed: usize,
        /// … of so many.
        all: usize,
    },
    /// A batch that cannot be done as asked for.
    #[error(transparent)]
    Batch(#[from] BatchError),
    /// Jobs of a batch without a result.
    #[error("{unfinished} of {all} jobs are not finished: the summary says why")]
    JobsUnfinished {
        /// So many are not …
        unfinished: usize,
        /// … of so many.
        all: usize,
    },
    /// A batch that a person or a cluster stopped.
    #[error("interrupted with {unfinished} jobs to go")]
    BatchInterrupted {
        /// So many are not finished.
        unfinished: usize,
    },
    /// A `--set` that does not apply.
    #[error(transparent)]
    Override(#[from] OverrideError),
    /// A measurement did not finish.
    #[error(transparent)]
    Lab(LabError),
    /// Backends could not be compared.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// A view that the scene does not have.
    #[error("the scene has no view `{view}`; its views are {known}")]
    UnknownView {
        /// What was asked for.
        view: String,
        /// What there is.
        known: String,
    },
    /// Options that do not go together.
    #[error("{0}")]
    Usage(String),
    /// A scene with problems, which have been printed.
    #[error("the scene is not ready: solve its problems first")]
    NotReady,
    /// The operating system gives no threads.
    #[error(
        "the system starts no threads: raise its limit (ulimit -u), or use fewer with --threads"
    )]
    Threads(#[source] rayon::ThreadPoolBuildError),
    /// The operating system does not tell of Ctrl-C.
    #[error("signals cannot be caught")]
    Interrupt(#[source] std::io::Error),
    /// A wireframe could not be exported.
    #[error(transparent)]
    Export(#[from] neat_export::ExportError),
    /// No browser could be started.
    #[error("no browser can be started ({reason}): open {report} yourself")]
    Browser {
        /// What was to be opened.
        report: String,
        /// What the system said.
        reason: String,
    },
    /// Nobody takes the output.
    #[error("the output cannot be written")]
    Output(#[from] std::io::Error),
}

/// Everything that a pipeline error can be made of.
macro_rules! through_pipeline {
    ($($error:ty),+) => {
        $(impl From<$error> for CliError {
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
    BackendError,
    TrainError,
    PlanError
);

impl From<LabError> for CliError {
    fn from(error: LabError) -> Self {
        match error {
            LabError::Pipeline(error) => Self::Pipeline(error),
            error => Self::Lab(error),
        }
    }
}

impl From<EvalError> for CliError {
    fn from(error: EvalError) -> Self {
        Self::Lab(error.into())
    }
}

impl CliError {
    /// The error of a command that has `--resume`.
    pub fn of_resumable(error: PipelineError) -> Self {
        match error {
            PipelineError::Interrupted { .. } | PipelineError::InterruptedIn(_) => {
                Self::Resumable(error)
            }
            error => Self::Pipeline(error),
        }
    }

    /// How to go on.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Resumable(_) => Some("give the same command with --resume to continue"),
            Self::Lab(LabError::AblationInterrupted { .. }) | Self::BatchInterrupted { .. } => {
                Some("give the same command again to continue")
            }
            _ => None,
        }
    }

    /// The exit code that tells scripts.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Resumable(_)
            | Self::BatchInterrupted { .. }
            | Self::Lab(LabError::AblationInterrupted { .. })
            | Self::Pipeline(PipelineError::Interrupted { .. } | PipelineError::InterruptedIn(_)) => {
                INTERRUPTED
            }
            Self::Pipeline(error) if error.is_bad_input() => BAD_INPUT,
            Self::Lab(error) if error.is_bad_input() => BAD_INPUT,
            Self::Override(_) | Self::UnknownView { .. } | Self::Usage(_) | Self::NotReady => {
                BAD_INPUT
            }
            Self::NoEdges { .. } => EMPTY,
            Self::Export(error) if error.is_bad_input() => BAD_INPUT,
            Self::Batch(error) if error.is_bad_input() => BAD_INPUT,
            // `neat info SCENE | head` is no failure.
            Self::Output(_) if self.is_closed_pipe() => 0,
            _ => FAILED,
        }
    }

    /// Whether nobody takes the output any more.
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == std::io::ErrorKind::BrokenPipe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use neat_pipeline::event::Stage;
    use std::io;

    #[test]
    fn every_way_to_be_interrupted_has_its_own_way_to_go_on() {
        let interrupted = || PipelineError::Interrupted {
            step: 7,
            checkpoint: "step-00000007.safetensors".into(),
        };
        let ablation = LabError::AblationInterrupted { done: 3, all: 20 };
        for (error, hint) in [
            (CliError::of_resumable(interrupted()), Some("--resume")),
            (
                CliError::of_resumable(PipelineError::InterruptedIn(Stage::Detect)),
                Some("--resume"),
            ),
            // Of a command without --resume.
            (interrupted().into(), None),
            (ablation.into(), Some("the same command again")),
        ] {
            assert_eq!(error.exit_code(), INTERRUPTED, "{error}");
            match hint {
                Some(part) => assert!(error.hint().is_some_and(|hint| hint.contains(part))),
                None => assert_eq!(error.hint(), None),
            }
        }
    }

    #[test]
    fn an_export_that_fails_is_no_bad_input() {
        let full_disk = SceneError::Write {
            path: "house.dxf".into(),
            source: io::ErrorKind::StorageFull.into(),
        };
        let failed = CliError::Export(full_disk.into());
        assert_eq!(failed.exit_code(), FAILED);
        let unknown = neat_export::Format::from_name("dwg").unwrap_err();
        assert_eq!(CliError::Export(unknown).exit_code(), BAD_INPUT);
    }
}
