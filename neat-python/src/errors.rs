//! Errors as exceptions, with the sentences of the command line.

use neat_core::{SceneError, with_causes};
use neat_eval::EvalError;
use neat_export::ExportError;
use neat_lab::LabError;
use neat_pipeline::config::OverrideError;
use neat_pipeline::error::PipelineError;
use neat_pipeline::run_dir::RunDirError;
use neat_tensor::BackendError;
use pyo3::{PyErr, import_exception};
use std::error::Error;
use std::fmt::Display;

import_exception!(neat3d.errors, InputError);
import_exception!(neat3d.errors, RunError);
import_exception!(neat3d.errors, Interrupted);
import_exception!(neat3d.errors, NeatWarning);

/// Something that was not done, on its way to Python.
#[derive(Debug)]
pub struct Failure {
    text: String,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Input,
    Run,
    Interrupted,
}

impl Failure {
    /// Arguments that cannot be used.
    pub fn input(text: impl Display) -> Self {
        Self {
            text: text.to_string(),
            kind: Kind::Input,
        }
    }

    fn new(error: &dyn Error, is_bad_input: bool) -> Self {
        Self {
            text: with_causes(error),
            kind: if is_bad_input { Kind::Input } else { Kind::Run },
        }
    }

    /// Whether somebody stopped the work.
    pub fn is_interrupt(&self) -> bool {
        matches!(self.kind, Kind::Interrupted)
    }
}

impl From<Failure> for PyErr {
    fn from(Failure { text, kind }: Failure) -> Self {
        match kind {
            Kind::Input => InputError::new_err(text),
            Kind::Run => RunError::new_err(text),
            Kind::Interrupted => {
                Interrupted::new_err(format!("{text}; give the same call with resume=True"))
            }
        }
    }
}

impl From<PipelineError> for Failure {
    fn from(error: PipelineError) -> Self {
        let mut failure = Self::new(&error, error.is_bad_input());
        if matches!(
            error,
            PipelineError::Interrupted { .. } | PipelineError::InterruptedIn(_)
        ) {
            failure.kind = Kind::Interrupted;
        }
        failure
    }
}

impl From<LabError> for Failure {
    fn from(error: LabError) -> Self {
        Self::new(&error, error.is_bad_input())
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        Self::new(&error, error.is_bad_input())
    }
}

/// Errors that are parts of larger ones.
macro_rules! through {
    ($larger:ty: $($error:ty),+) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                <$larger>::from(error).into()
            }
        })+
    };
}
through!(PipelineError: SceneError, RunDirError, BackendError);
through!(LabError: EvalError, OverrideError);
through!(ExportError: neat_wireframe::export::ExportError);
