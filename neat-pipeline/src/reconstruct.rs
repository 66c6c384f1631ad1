//! From a scene on disk to a run folder: training, distillation, and both.

mod backend_choice;
mod device_failure;
mod opened;
mod report;
mod results;
mod session;
mod training;

pub use backend_choice::backend_for;
pub use opened::{OpenedRun, open_run, software_warning};

use crate::config::{Choice, Config, FieldUse};
use crate::distill::BackEndReport;
use crate::error::PipelineError;
use crate::event::{OnEvent, Stage};
use crate::run_dir::{Existing, RunDir};
use neat_core::file_cache::FileCache;
use neat_core::{MemoryLimit, Wireframe3d};
use neat_tensor::Backend;
use neat_wireframe::metrics::ImageEvidence;
use session::Session;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// What to run, where, and how long.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The folder of the scene.
    pub scene: PathBuf,
    /// The folder of the run.
    pub out: PathBuf,
    /// What to do about a folder that already holds something.
    pub existing: Existing,
    /// What is asked for; the scene and the machine settle what it leaves open.
    pub config: Config,
    /// What the configuration started from, for the manifest.
    pub preset: String,
    /// What computes.
    pub backend: Backend,
    /// Seed of all randomness.
    pub seed: u64,
    /// Training ends after this long, if its steps are not done before; the
    /// schedules of the optimisation are shortened with it.
    pub time_budget: Option<Duration>,
    /// Whether the scene is examined first, quickly: problems end the run before it
    /// begins.
    pub examine: bool,
    /// Keeps what takes long, such as detected 2D wireframes, for the next run.
    pub cache: Option<FileCache>,
    /// How much memory may be used. It decides how images are kept and how many are
    /// worked on at once, and `train.ray_chunk` where that is open and a step would not
    /// fit.
    pub memory_limit: MemoryLimit,
    /// The arguments of the program, for the manifest.
    pub command_line: Vec<String>,
}

/// What a run came to.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The folder with all results.
    pub run: RunDir,
    /// The wireframe, in the frame of the user's files.
    pub wireframe: Wireframe3d,
    /// How well it agrees with the images.
    pub agreement: Option<ImageEvidence>,
    /// Numbers of every step of the distillation; `None` if another version wrote them.
    pub report: Option<BackEndReport>,
}

/// Trains on a scene and leaves a run folder with checkpoints, also where no back end
/// would ask the field.
///
/// `cancelled` is looked at before every step and between the views that are
/// detected: once it is set, the last state is written and the run ends.
///
/// [`Existing::Resume`] continues where a run ended, in whatever way, and comes to the
/// same bytes as without the interruption, on the same backend. Under a time budget
/// the schedules follow the clock: the bytes are others then.
///
/// # Errors
/// If the scene, the folder or the backend cannot be used, the optimisation
/// fails, or the disk is full; [`PipelineError::Interrupted`] after
/// cancellation; [`PipelineError::Changed`] if the run began with something else.
/// What has been written stays.
pub fn train(
    options: &RunOptions,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<RunDir, PipelineError> {
    let mut options = options.clone();
    if options.config.distill.field == Choice::Auto {
        options.config.distill.field = Choice::Given(FieldUse::Trained);
    }
    let options = &options;
    Session::start(options, cancelled, on_event)?.finish(|session| {
        if !session.finished {
            session.train(options, cancelled)?;
        }
        Ok(session.dir.clone())
    })
}

/// Trains on a scene, unless the images alone make the wireframe, distils it and writes
/// all results.
///
/// # Errors
/// As [`train`], or if no wireframe can be taken out of the field.
pub fn reconstruct(
    options: &RunOptions,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<Reconstruction, PipelineError> {
    Session::start(options, cancelled, on_event)?.finish(|session| {
        if session.finished
            && let Some(result) = session.earlier_result()
        {
            return Ok(result);
        }
        let field = if session.plan.trains() {
            Some(session.train(options, cancelled)?)
        } else {
            None
        };
        session.distill(field.as_ref(), cancelled)
    })
}

/// Distils the wireframe of a run once more, from its last checkpoint if it has one, and writes
/// the results into its folder.
///
/// # Errors
/// If the run or its scene cannot be read, no wireframe can be taken out of the
/// field, or the disk is full.
pub fn distill_run(
    opened: OpenedRun,
    on_event: OnEvent<'_>,
) -> Result<Reconstruction, PipelineError> {
    let lock = opened.dir.lock()?;
    let field = opened.field;
    let mut session = Session {
        dir: opened.dir,
        plan: opened.plan,
        manifest: opened.manifest,
        scene: opened.scene,
        device: opened.device,
        dense_points: Vec::new(),
        ray_chunk: None,
        finished: false,
        on_event,
        _lock: lock,
    };
    // Distillation is repeated: only the last one's time counts.
    for stage in [Stage::Distill, Stage::Export] {
        session.manifest.seconds.remove(&stage);
    }
    session.forget_distillation_warnings();
    // How the training ended stays as it is.
    let result = session.distill(field.as_ref(), &AtomicBool::new(false));
    let recorded = session.write_manifest();
    // Of two errors the first is the cause.
    let reconstruction = result?;
    recorded?;
    Ok(reconstruction)
}
