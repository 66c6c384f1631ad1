//! A reconstruction as the C interface asks for it.

use crate::numbers::Numbers;
use neat_core::file_cache::FileCache;
use neat_core::{MemoryLimit, with_causes};
use neat_pipeline::config::{Choice, FieldUse, Preset, apply_overrides};
use neat_pipeline::error::PipelineError;
use neat_pipeline::event::Event;
use neat_pipeline::reconstruct::{RunOptions, reconstruct};
use neat_pipeline::resources::default_limit;
use neat_pipeline::run_dir::Existing;
use neat_tensor::Backend;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What is asked for; `Option`s and zeros stand for the defaults of `neat reconstruct`.
#[derive(Debug, Default)]
pub struct Request {
    pub scene: PathBuf,
    pub out: PathBuf,
    pub existing: Existing,
    pub preset: Option<String>,
    pub backend: Option<String>,
    pub cache: Option<PathBuf>,
    pub settings: Vec<String>,
    pub seed: u64,
    pub time_budget_in_seconds: f64,
    pub memory_limit_in_bytes: u64,
    pub train: bool,
    pub skip_examination: bool,
}

/// Why there is no wireframe, in words.
#[derive(Debug)]
pub enum Failure {
    /// What was asked for, or the input, cannot be used.
    BadInput(String),
    /// The run failed.
    Failed(String),
    /// The listener ended it.
    Cancelled(String),
}

impl Failure {
    /// Of an argument that cannot be used.
    pub fn of_argument(error: &dyn Error) -> Self {
        Self::BadInput(with_causes(error))
    }

    fn of_run(error: &PipelineError) -> Self {
        let text = with_causes(error);
        match error {
            PipelineError::Interrupted { .. } | PipelineError::InterruptedIn(_) => {
                Self::Cancelled(text)
            }
            error if error.is_bad_input() => Self::BadInput(text),
            _ => Self::Failed(text),
        }
    }
}

/// What a run tells.
#[derive(Debug, PartialEq)]
pub enum Told {
    /// A stage begins.
    Stage(String),
    /// So much of the stage that began last is done.
    Progress(f64),
    /// Something about the scene, or a decision with its reason.
    Note(String),
    /// Something that a person should know.
    Warning(String),
    /// A file is complete.
    File(String),
}

impl Told {
    fn of(event: Event<'_>) -> Option<Self> {
        Some(match event {
            Event::StageStarted(stage) => Self::Stage(stage.to_string()),
            Event::StageProgress { fraction, .. } | Event::Step { fraction, .. } => {
                Self::Progress(fraction)
            }
            Event::StageFinished { .. } => Self::Progress(1.0),
            Event::Note(text) => Self::Note(text),
            Event::Decided(decision) => Self::Note(decision.to_string()),
            Event::Resumed { step, steps } => {
                Self::Note(format!("continued after step {step} of {steps}"))
            }
            Event::Warning(warning) => Self::Warning(warning.to_string()),
            Event::FileWritten(path) => Self::File(path.display().to_string()),
            // How far the detection has come is told beside it.
            Event::Detected(_) => return None,
        })
    }
}

impl Request {
    fn options(&self) -> Result<RunOptions, Failure> {
        let preset: Preset = match &self.preset {
            Some(name) => name.parse().map_err(|error| Failure::of_argument(&error))?,
            None => Preset::default(),
        };
        let mut config = apply_overrides(&preset.config(), &self.settings)
            .map_err(|error| Failure::of_argument(&error))?;
        if self.train {
            config.distill.field = Choice::Given(FieldUse::Trained);
        }
        let backend = match &self.backend {
            Some(name) => name.parse().map_err(|error| Failure::of_argument(&error))?,
            None => Backend::Auto,
        };
        let seconds = self.time_budget_in_seconds;
        let budget = Duration::try_from_secs_f64(seconds).map_err(|_| {
            Failure::BadInput(format!(
                "time_budget_in_seconds is {seconds}: give a number above 0, or 0 for none"
            ))
        })?;
        Ok(RunOptions {
            scene: self.scene.clone(),
            out: self.out.clone(),
            existing: self.existing,
            config,
            preset: preset.to_string(),
            backend,
            seed: self.seed,
            time_budget: (budget > Duration::ZERO).then_some(budget),
            examine: !self.skip_examination,
            cache: self.cache.clone().map(FileCache::new),
            memory_limit: match self.memory_limit_in_bytes {
                0 => default_limit(),
                bytes => MemoryLimit::of_bytes(bytes),
            },
            command_line: vec!["neat_reconstruct".to_owned()],
        })
    }

    /// Runs it. `listen` hears what happens, and ends the run by `false`.
    ///
    /// # Errors
    /// Those of the run, in words.
    pub fn run(&self, listen: &mut dyn FnMut(&Told) -> bool) -> Result<Numbers, Failure> {
        let options = self.options()?;
        let cancelled = AtomicBool::new(false);
        let result = reconstruct(&options, &cancelled, &mut |event| {
            if Told::of(event).is_some_and(|told| !listen(&told)) {
                cancelled.store(true, Ordering::Relaxed);
            }
        });
        let run = result.map_err(|error| Failure::of_run(&error))?.run;
        read(&run.wireframe("json"))
    }
}

/// A wireframe that is on disk.
///
/// # Errors
/// If the file cannot be read.
pub fn read(path: &Path) -> Result<Numbers, Failure> {
    Numbers::read(path).map_err(|error| Failure::of_argument(&error))
}
