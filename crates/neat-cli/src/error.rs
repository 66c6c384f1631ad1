//! What ends a command early, and the exit code that tells scripts.

use crate::output;
use neat_core::SceneError;
use neat_core::synthetic::SyntheticError;
use neat_eval::EvalError;
use neat_pipeline::compare_backends::CompareError;
use neat_pipeline::error::PipelineError;
use neat_pipeline::overrides::OverrideError;
use neat_pipeline::run_dir::RunDirError;
use neat_pipeline::trainer::TrainError;
use neat_tensor::BackendError;
use std::error::Error;
use std::process::ExitCode;

/// Exit code of a run that failed.
const FAILED: u8 = 1;
/// Exit code of arguments or input that cannot be used; clap uses it too.
const BAD_INPUT: u8 = 2;
/// Exit code after Ctrl-C, by the convention of shells: 128 + SIGINT.
pub const INTERRUPTED: u8 = 130;

/// Why a command did not do what was asked for.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// A run did not finish.
    #[error(transparent)]
    Pipeline(PipelineError),
    /// A `--set` that does not apply.
    #[error(transparent)]
    Override(#[from] OverrideError),
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
    #[error("the threads asked for cannot be started: use fewer with --threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The operating system does not tell of Ctrl-C.
    #[error("Ctrl-C cannot be caught")]
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
    SyntheticError,
    EvalError
);

impl CliError {
    /// Prints the error with its causes, once, and returns the exit code.
    pub fn report(&self) -> ExitCode {
        let code = self.exit_code();
        if !self.is_closed_pipe() {
            output::error(&self.chain());
        }
        if let Self::Pipeline(PipelineError::Interrupted { .. }) = self {
            output::error_hint("give the same command with --resume to continue");
        }
        code.into()
    }

    fn exit_code(&self) -> u8 {
        match self {
            Self::Pipeline(PipelineError::Interrupted { .. }) => INTERRUPTED,
            Self::Pipeline(error) if error.is_bad_input() => BAD_INPUT,
            Self::Override(_)
            | Self::UnknownView { .. }
            | Self::Usage(_)
            | Self::Export(_)
            | Self::Threads(_)
            | Self::NotReady => BAD_INPUT,
            // `neat info SCENE | head` is no failure.
            Self::Output(_) if self.is_closed_pipe() => 0,
            _ => FAILED,
        }
    }

    fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == std::io::ErrorKind::BrokenPipe)
    }

    /// The message and what caused it, in one sentence.
    fn chain(&self) -> String {
        let mut text = self.to_string();
        let mut cause = self.source();
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
}
