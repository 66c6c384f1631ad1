//! What a run tells while it works. Libraries report; only a user interface
//! draws.

use neat_core::View;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::fmt;
use std::path::PathBuf;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

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
    /// Photographs are matched for points on surfaces.
    Match,
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
            Self::Match => "match",
            Self::Train => "train",
            Self::Distill => "distill",
            Self::Export => "export",
            Self::Evaluate => "evaluate",
        })
    }
}

/// What the scene or the machine decided, where the configuration leaves it open.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Decision {
    /// What was decided: a key of the configuration, or words.
    pub setting: String,
    /// The value.
    pub value: String,
    /// Why, to follow the value after a comma.
    pub reason: String,
}

impl fmt::Display for Decision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}, {}", self.setting, self.value, self.reason)
    }
}

/// The setting of the decision about poses.
pub const POSES: &str = "poses";

/// What a warning is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WarningKind {
    /// A GPU that is a program.
    SoftwareDriver,
    /// Files of the scene.
    Scene,
    /// The detection of 2D wireframes.
    Detection,
    /// What an examination found.
    Examination,
    /// A setting that does nothing.
    NoEffect,
    /// A checkpoint that cannot be read.
    DamagedCheckpoint,
    /// Another program or backend than the run began with.
    OtherProgram,
    /// Numbers that grew beyond all bounds.
    Divergence,
    /// A device that failed.
    DeviceFailure,
    /// A wireframe without edges.
    NoEdges,
    /// No `report.html`.
    NoReport,
    /// A part of a larger work that failed.
    Part,
    /// Anything, by another version.
    #[serde(other)]
    Other,
}

/// Something that a person should know and that does not stop the run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "StoredWarning")]
pub struct Warning {
    /// What it is about.
    pub kind: WarningKind,
    /// The whole of it, in words.
    pub message: String,
}

impl Warning {
    /// A warning.
    pub fn new(kind: WarningKind, message: impl Into<String>) -> Self {
        let message = message.into();
        Self { kind, message }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// Earlier versions stored the message alone.
#[derive(Deserialize)]
#[serde(untagged)]
enum StoredWarning {
    Message(String),
    Warning { kind: WarningKind, message: String },
}

impl From<StoredWarning> for Warning {
    fn from(stored: StoredWarning) -> Self {
        match stored {
            StoredWarning::Message(message) => Self::new(WarningKind::Other, message),
            StoredWarning::Warning { kind, message } => Self { kind, message },
        }
    }
}

/// One message of a run. `R` is what a step of an optimisation reports; where there is none,
/// `()`.
#[derive(Clone, Debug)]
pub enum Event<'a, R> {
    /// A stage begins.
    StageStarted(Stage),
    /// So much of a stage is done.
    StageProgress {
        /// The stage.
        stage: Stage,
        /// From 0 to 1.
        fraction: f64,
    },
    /// The 2D wireframe of a view was detected, in image coordinates.
    Detected(&'a View),
    /// One optimisation step is done.
    Step {
        /// Losses and the like.
        report: &'a R,
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
    /// The scene or the machine has decided something.
    Decided(Decision),
    /// The training goes on from a checkpoint.
    Resumed {
        /// Steps that are done.
        step: u64,
        /// All steps.
        steps: u64,
    },
    /// Something that a person should know and that does not stop the run.
    Warning(Warning),
    /// A result that a person may want to open is on disk.
    FileWritten(PathBuf),
}

impl<R: Serialize> Event<'_, R> {
    /// The event for programs: `event` says which, `time` when, in seconds since 1970.
    pub fn to_json(&self) -> Value {
        let mut value = match self {
            Event::StageStarted(stage) => json!({ "event": "stage_started", "stage": stage }),
            Event::StageProgress { stage, fraction } => {
                json!({ "event": "stage_progress", "stage": stage, "fraction": fraction })
            }
            Event::Detected(view) => {
                json!({ "event": "detected", "view": view.name, "segments": view.wireframe.edges.len() })
            }
            Event::StageFinished { stage, seconds } => {
                json!({ "event": "stage_finished", "stage": stage, "seconds": seconds })
            }
            Event::Step { report, fraction } => {
                json!({ "event": "step", "fraction": fraction, "report": report })
            }
            Event::Note(message) => json!({ "event": "note", "message": message }),
            Event::Decided(decision) => json!({
                "event": "decision",
                "setting": decision.setting,
                "value": decision.value,
                "reason": decision.reason,
            }),
            Event::Resumed { step, steps } => {
                json!({ "event": "resumed", "step": step, "steps": steps })
            }
            Event::Warning(warning) => {
                json!({ "event": "warning", "kind": warning.kind, "message": warning.message })
            }
            Event::FileWritten(path) => {
                json!({ "event": "file_written", "path": path.display().to_string() })
            }
        };
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        value["time"] = json!(since_1970.map_or(0.0, |time| time.as_secs_f64()));
        value
    }
}

/// Who listens to the events of a run.
pub type OnEvent<'a, R> = &'a mut dyn FnMut(Event<'_, R>);

/// Does a stage and tells when it begins and ends.
///
/// # Errors
/// Those of the work.
pub fn timed<T, E, R>(
    on_event: OnEvent<'_, R>,
    stage: Stage,
    work: impl FnOnce(OnEvent<'_, R>) -> Result<T, E>,
) -> Result<T, E> {
    let _span = tracing::info_span!("stage", %stage).entered();
    on_event(Event::StageStarted(stage));
    let start = Instant::now();
    let value = work(on_event)?;
    let seconds = start.elapsed().as_secs_f64();
    tracing::info!(seconds, "done");
    on_event(Event::StageFinished { stage, seconds });
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_of_all_versions_are_read() {
        let read = |text: &str| serde_json::from_str::<Warning>(text).unwrap();
        let warning = Warning::new(WarningKind::NoEdges, "no edges");
        let text = serde_json::to_string(&warning).unwrap();
        assert_eq!(text, r#"{"kind":"no_edges","message":"no edges"}"#);
        assert_eq!(read(&text), warning);
        let other = Warning::new(WarningKind::Other, "no edges");
        assert_eq!(read("\"no edges\""), other);
        let newer = r#"{"kind":"of_tomorrow","message":"no edges"}"#;
        assert_eq!(read(newer), other);
    }

    #[test]
    fn programs_read_an_event_by_its_name() {
        let warning = Warning::new(WarningKind::NoEdges, "no edges");
        let value = Event::<()>::Warning(warning).to_json();
        assert_eq!(value["event"], "warning");
        assert_eq!(value["kind"], "no_edges");
        assert!(value["time"].as_f64().unwrap() > 1e9);
        let value = Event::<()>::StageStarted(Stage::Train).to_json();
        assert_eq!(value["stage"], "train");
        assert!(!value.to_string().contains('\n'));
    }
}
