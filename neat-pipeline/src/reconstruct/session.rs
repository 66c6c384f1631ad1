//! A run in progress: its folder, its scene, and its manifest kept up to date.

use super::RunOptions;
use crate::changes::Belonging;
use crate::config::Config;
use crate::error::PipelineError;
use crate::estimate::fit_memory;
use crate::event::{Event, OnEvent, Stage, timed};
use crate::manifest::{Manifest, Status, hash_inputs, utc_now};
use crate::resources::Resources;
use crate::run_dir::{Existing, RunDir, RunDirError, RunLock};
use crate::scene::{examine_quickly, prepare_scene};
use burn::tensor::Device;
use neat_core::{Scene, SceneError, file, hawp_json};
use neat_tensor::Backend;
use neat_tensor::backend::software_driver;
use neat_train::TrainError;
use neat_train::TrainedField;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A run in progress.
pub(super) struct Session<'a> {
    pub dir: RunDir,
    pub config: Config,
    pub manifest: Manifest,
    pub scene: Scene,
    pub device: Device,
    /// Rays per pass, where the device could not take as many as configured.
    pub ray_chunk: Option<usize>,
    /// Whether the run had ended when the session began.
    pub finished: bool,
    pub on_event: OnEvent<'a>,
    /// Keeps other processes out of the folder.
    pub _lock: RunLock,
}

/// The part of a run that is on disk already.
struct Earlier {
    manifest: Manifest,
    config: Config,
}

impl<'a> Session<'a> {
    /// Reads the scene, then makes the run folder with `config.toml` and a first
    /// `manifest.json`: bad input leaves no folder behind.
    pub fn start(
        options: &RunOptions,
        cancelled: &AtomicBool,
        on_event: OnEvent<'a>,
    ) -> Result<Self, PipelineError> {
        RunDir::check(&options.out, options.existing)?;
        // Once: looking for GPUs takes a while.
        let backend = options.backend.resolve();
        let device = backend.device()?;
        let earlier = match options.existing {
            Existing::Resume => earlier(&options.out, on_event)?,
            Existing::Refuse | Existing::Overwrite => None,
        };
        let scene_dir = absolute(&options.scene)?;

        let mut warnings: Vec<String> = software_warning(&device).into_iter().collect();
        for warning in &warnings {
            on_event(Event::Warning(warning.clone()));
        }
        let placed = earlier.as_ref().and_then(|e| e.manifest.sphere.as_ref());
        let mut config = options.config.clone();
        let resources = Resources {
            cache: options.cache.as_ref(),
            memory_limit: options.memory_limit,
            cancelled: Some(cancelled),
        };
        let prepared = prepare_scene(&scene_dir, &mut config, placed, resources, on_event)?;
        // Before anything is written; what depends on the scene is decided now.
        config.training().validate()?;
        let limit = options.memory_limit;
        // A GPU has memory of its own.
        if let Some(earlier) = &earlier {
            // A run keeps the passes that it began with, whatever memory is here.
            config.train.ray_chunk = earlier.config.train.ray_chunk;
        } else if backend != Backend::Wgpu {
            fit_memory(&mut config, limit, on_event);
        }
        warnings.extend(prepared.warnings);
        let mut seconds = prepared.seconds;
        if options.examine && earlier.is_none() {
            let (found, time) = timed(on_event, Stage::Examine, |on_event| {
                examine_quickly(&prepared.scene, &config.data, limit, on_event)
            })?;
            warnings.extend(found);
            seconds.insert(Stage::Examine, time);
        }
        let inputs = hash_inputs(&scene_dir, &prepared.files)?;
        if cancelled.load(Ordering::Relaxed) {
            return Err(PipelineError::InterruptedIn(Stage::Load));
        }

        let now = utc_now();
        let mut manifest = Manifest {
            neat: env!("CARGO_PKG_VERSION").to_owned(),
            compiler: env!("NEAT_RUSTC").to_owned(),
            target: env!("NEAT_TARGET").to_owned(),
            command_line: options.command_line.clone(),
            preset: options.preset.clone(),
            backend: backend.to_string(),
            device: device_name(&device),
            threads: rayon::current_num_threads(),
            seed: options.seed,
            scene: scene_dir,
            sphere: Some(prepared.sphere),
            inputs,
            warnings,
            status: Status::Running,
            steps: 0,
            started: now.clone(),
            updated: now,
            seconds: BTreeMap::new(),
        };
        let mut finished = false;
        if let Some(Earlier {
            manifest: before,
            config: configured,
        }) = &earlier
        {
            let now = Belonging::new(&config, &manifest)?;
            let then = Belonging::new(configured, before)?;
            then.refuse_changes(&now, &options.out)?;
            refuse_other_state(&now, &options.out)?;
            warn_of_other_programs(before, &mut manifest, on_event);
            finished = before.status == Status::Finished;
            manifest.steps = before.steps;
            manifest.started.clone_from(&before.started);
            manifest.seconds.clone_from(&before.seconds);
            for warning in &before.warnings {
                if !manifest.warnings.contains(warning) {
                    manifest.warnings.push(warning.clone());
                }
            }
        }
        let (dir, lock) = RunDir::create(&options.out, options.existing)?;
        let mut session = Self {
            dir,
            config,
            manifest,
            scene: prepared.scene,
            device,
            ray_chunk: None,
            finished,
            on_event,
            _lock: lock,
        };
        for (stage, seconds) in seconds {
            session.add_seconds(stage, seconds);
        }
        if finished {
            return Ok(session);
        }
        session.set_damaged_aside()?;
        session.dir.write_config(&session.config)?;
        if prepared.detected {
            session.write_detections()?;
        }
        // The last of the three: now the folder holds a run.
        session.write_manifest()?;
        Ok(session)
    }

    /// Renames checkpoints that cannot be read, so that they do not stand in the way
    /// of those to come.
    fn set_damaged_aside(&mut self) -> Result<(), PipelineError> {
        let Some(usable) = self.dir.usable_checkpoint()? else {
            return Ok(());
        };
        for (path, error) in usable.damaged {
            self.dir.set_aside(&path)?;
            let used = usable.path.display();
            self.warn(&format!("{error}: {used} is used instead"));
        }
        Ok(())
    }

    /// Does the work of the run and records in the manifest how it ended.
    pub fn finish<T>(
        mut self,
        work: impl FnOnce(&mut Self) -> Result<T, PipelineError>,
    ) -> Result<T, PipelineError> {
        let result = work(&mut self);
        self.manifest.status = match &result {
            Ok(_) => Status::Finished,
            Err(PipelineError::Interrupted { .. } | PipelineError::InterruptedIn(_)) => {
                Status::Interrupted
            }
            Err(_) => Status::Failed,
        };
        let recorded = self.write_manifest();
        // Of two errors the first is the cause.
        let value = result?;
        recorded?;
        Ok(value)
    }

    /// Does a part of the work, tells when it begins and ends, and adds its time.
    pub fn stage<T>(
        &mut self,
        stage: Stage,
        work: impl FnOnce(&mut Self) -> Result<T, PipelineError>,
    ) -> Result<T, PipelineError> {
        (self.on_event)(Event::StageStarted(stage));
        let start = Instant::now();
        let value = work(self)?;
        let seconds = start.elapsed().as_secs_f64();
        self.add_seconds(stage, seconds);
        (self.on_event)(Event::StageFinished { stage, seconds });
        Ok(value)
    }

    /// Writes the 2D wireframes that were detected, as files that a scene can have.
    fn write_detections(&mut self) -> Result<(), PipelineError> {
        file::create_dir(&self.dir.detections())?;
        for view in &self.scene.views {
            let path = self.dir.detection(&view.name);
            hawp_json::write(&path, &view.wireframe, self.scene.pixel_center)?;
        }
        Ok(())
    }

    pub fn warn(&mut self, warning: &str) {
        self.manifest.warnings.push(warning.to_owned());
        (self.on_event)(Event::Warning(warning.to_owned()));
    }

    pub fn written(&mut self, path: PathBuf) {
        (self.on_event)(Event::FileWritten(path));
    }

    pub fn write_manifest(&mut self) -> Result<(), PipelineError> {
        self.manifest.updated = utc_now();
        Ok(self.dir.write_manifest(&self.manifest)?)
    }

    fn add_seconds(&mut self, stage: Stage, seconds: f64) {
        *self.manifest.seconds.entry(stage).or_default() += seconds;
    }
}

/// The run in `out` that can be continued.
fn earlier(out: &Path, on_event: OnEvent<'_>) -> Result<Option<Earlier>, PipelineError> {
    let Some(dir) = RunDir::to_resume(out)? else {
        let note = format!("{} holds no run yet: it begins", out.display());
        on_event(Event::Note(note));
        return Ok(None);
    };
    Ok(Some(Earlier {
        manifest: dir.manifest()?,
        config: dir.config()?,
    }))
}

/// Refuses the state in `out` if it belongs to something else than what is about to
/// continue: `config.toml` may have been changed by hand.
fn refuse_other_state(now: &Belonging, out: &Path) -> Result<(), PipelineError> {
    let Some(usable) = RunDir::open(out)?.usable_checkpoint()? else {
        return Ok(());
    };
    match Belonging::read_from(&usable.checkpoint.metadata) {
        Some(then) => then.refuse_changes(now, out),
        None => Err(TrainError::Checkpoint("config".to_owned()).into()),
    }
}

/// The same bytes can be promised for the same program on the same backend only.
fn warn_of_other_programs(before: &Manifest, now: &mut Manifest, on_event: OnEvent<'_>) {
    let described = |m: &Manifest| format!("neat {} on {}", m.neat, m.backend);
    let (then, with) = (described(before), described(now));
    if then != with {
        let warning = format!(
            "the run began with {then} and continues with {with}: the result may differ in the last digits"
        );
        on_event(Event::Warning(warning.clone()));
        now.warnings.push(warning);
    }
}

/// A run that has been, with its scene and its trained field.
#[derive(Debug)]
pub struct OpenedRun {
    /// Its folder.
    pub dir: RunDir,
    /// Its configuration.
    pub config: Config,
    /// Its manifest.
    pub manifest: Manifest,
    /// Its scene.
    pub scene: Scene,
    /// What computes.
    pub device: Device,
    /// The field of its last checkpoint.
    pub field: TrainedField,
}

/// Opens the run in the folder `run`: reads its configuration, changed by
/// `configure`, its scene, and its last checkpoint.
///
/// `scene` is the folder of the scene; `None` takes the one that the run was
/// trained on.
///
/// # Errors
/// If a part of the run or the scene cannot be read, or the backend cannot be
/// used.
pub fn open_run<E>(
    run: &Path,
    scene: Option<&Path>,
    backend: Backend,
    resources: Resources<'_>,
    configure: impl FnOnce(Config) -> Result<Config, E>,
    on_event: OnEvent<'_>,
) -> Result<OpenedRun, E>
where
    E: From<PipelineError>,
{
    let dir = RunDir::open(run).map_err(PipelineError::from)?;
    let config = configure(dir.config().map_err(PipelineError::from)?)?;
    Ok(read_run(dir, config, scene, backend, resources, on_event)?)
}

fn read_run(
    dir: RunDir,
    mut config: Config,
    scene: Option<&Path>,
    backend: Backend,
    resources: Resources<'_>,
    on_event: OnEvent<'_>,
) -> Result<OpenedRun, PipelineError> {
    let device = backend.device()?;
    if let Some(warning) = software_warning(&device) {
        on_event(Event::Warning(warning));
    }
    let manifest = dir.manifest()?;
    let scene_dir = scene.unwrap_or(&manifest.scene);
    let placed = manifest.sphere.as_ref();
    let prepared = prepare_scene(scene_dir, &mut config, placed, resources, on_event)?;
    let no_checkpoint = || RunDirError::NoCheckpoint(dir.root().into());
    let usable = dir.usable_checkpoint()?.ok_or_else(no_checkpoint)?;
    for (_, error) in &usable.damaged {
        let used = usable.path.display();
        on_event(Event::Warning(format!("{error}: {used} is used instead")));
    }
    let field = TrainedField::load(&config.training(), &usable.checkpoint, &device)?;
    Ok(OpenedRun {
        dir,
        config,
        manifest,
        scene: prepared.scene,
        device,
        field,
    })
}

/// What a person should know who computes through a software driver.
pub fn software_warning(device: &Device) -> Option<String> {
    let driver = software_driver(device)?;
    Some(format!(
        "{driver} is a software driver, not a GPU: right but slow; `--backend flex` is many times faster"
    ))
}

/// The path from the root, so that the manifest leads there from anywhere.
fn absolute(path: &Path) -> Result<PathBuf, SceneError> {
    std::path::absolute(path).map_err(|source| SceneError::Read {
        path: path.into(),
        source,
    })
}

/// The name of a GPU; only those have one.
#[cfg(feature = "wgpu")]
fn device_name(device: &Device) -> String {
    let identity = device.identity();
    identity.map_or_else(|| "CPU".to_owned(), |identity| identity.name)
}

/// Without GPU backends everything is computed by the CPU.
#[cfg(not(feature = "wgpu"))]
fn device_name(_: &Device) -> String {
    "CPU".to_owned()
}
