//! What a run tells while it works. Libraries report; only a user interface
//! draws.

use crate::error::PipelineError;
use neat_train::trainer::StepReport;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

/// A part of a run that takes time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// A synthetic scene is made and written.
    Synthesise,
    /// Images, poses and 2D wireframes are read.
    Load,
    /// 2D wireframes are detected, where the scene has none.
    Detect,
    /// Poses and images are examined, see the crate `neat-doctor`.
    Examine,
    /// The fields are optimised.
    Train,
    /// The wireframe is taken out of the fields.
    Distill,
    /// Result files and pictures are written.
    Export,
    /// The wireframe is compared to the truth.
    Evaluate,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Synthesise => "synthesise",
            Self::Load => "load",
            Self::Detect => "detect",
            Self::Examine => "examine",
            Self::Train => "train",
            Self::Distill => "distill",
            Self::Export => "export",
            Self::Evaluate => "evaluate",
        })
    }
}

/// One message of a run.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// A stage begins.
    StageStarted(Stage),
    /// So much of a stage is done.
    StageProgress {
        /// The stage.
        stage: Stage,
        /// From 0 to 1.
        fraction: f64,
    },
    /// One optimisation step is done.
    Step {
        /// Losses and the like.
        report: &'a StepReport,
        /// So much of the training is done, by steps or by time: from 0 to 1.
        fraction: f64,
    },
    /// A stage is done.
    StageFinished {
        /// The stage.
        stage: Stage,
        /// How long it took.
        seconds: f64,
    },
    /// A fact about the scene that a person should check, such as where its sphere
    /// is.
    Note(String),
    /// Something that a person should know and that does not stop the run.
    Warning(String),
    /// A result that a person may want to open is on disk.
    FileWritten(PathBuf),
}

/// Who listens to the events of a run.
pub type OnEvent<'a> = &'a mut dyn FnMut(Event<'_>);

/// Does a stage, tells when it begins and ends, and returns its time too.
pub(crate) fn timed<T>(
    on_event: OnEvent<'_>,
    stage: Stage,
    work: impl FnOnce(OnEvent<'_>) -> Result<T, PipelineError>,
) -> Result<(T, f64), PipelineError> {
    on_event(Event::StageStarted(stage));
    let start = Instant::now();
    let value = work(on_event)?;
    let seconds = start.elapsed().as_secs_f64();
    on_event(Event::StageFinished { stage, seconds });
    Ok((value, seconds))
}
