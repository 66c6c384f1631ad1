//! A run in progress: its folder, its scene, and its manifest kept up to date.

use super::RunOptions;
use super::backend_choice::{backend_for, is_too_little_for_a_gpu};
use super::opened::software_warning;
use crate::changes::Belonging;
use crate::config::{Config, FieldUse};
use crate::error::PipelineError;
use crate::event::{Decision, Event, OnEvent, Stage, Warning, WarningKind, timed};
use crate::manifest::{Manifest, Status, hash_inputs, utc_now};
use crate::plan::{
    Given, Machine, NO_FIELD, Plan, changes_of_presets, settings_without_effect, settle,
    settle_field_use,
};
use crate::resources::Resources;
use crate::run_dir::{Existing, RunDir, RunLock};
use crate::scene::{PreparedScene, examine_quickly, prepare_scene};
use burn::tensor::Device;
use neat_core::{Scene, SceneError, file, hawp_json};
use neat_tensor::Backend;
use neat_tensor::backend::gpu_name;
use neat_train::{OrientedPoint, TrainError};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A run in progress.
pub(super) struct Session<'a> {
    pub dir: RunDir,
    pub plan: Plan,
    pub manifest: Manifest,
    pub scene: Scene,
    pub device: Device,
    /// Points on surfaces beside the sparse ones of the scene.
    pub dense_points: Vec<OrientedPoint>,
    /// Rays per pass, where the device could not take as many as planned.
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
    plan: Plan,
}

impl<'a> Session<'a> {
    /// Reads the scene and settles what is open, then makes the run folder with
    /// `config.toml`, `plan.toml` and a first `manifest.json`: bad input leaves no folder
    /// behind.
    pub fn start(
        options: &RunOptions,
        cancelled: &AtomicBool,
        on_event: OnEvent<'a>,
    ) -> Result<Self, PipelineError> {
        RunDir::check(&options.out, options.existing)?;
        let trains = settle_field_use(&options.config.distill)? == FieldUse::Trained;
        // Once: looking for GPUs takes a while.
        let backend = match trains {
            true => backend_for(options.backend, &options.config),
            false => options.backend.resolve_on_host(),
        };
        let device = backend.device()?;
        let earlier = match options.existing {
            Existing::Resume => earlier(&options.out, on_event)?,
            Existing::Refuse | Existing::Overwrite => None,
        };
        let mut manifest = begun_now(options, backend, &device)?;
        let mut tell = |event: Event<'_>| {
            manifest.record(&event);
            on_event(event);
        };
        if trains {
            tell_of_device(options, backend, &device, &mut tell);
        }
        let (prepared, plan) = prepare(options, backend, earlier.as_ref(), cancelled, &mut tell)?;
        manifest.sphere = Some(prepared.sphere);
        manifest.inputs = hash_inputs(&manifest.scene, &prepared.files)?;
        if cancelled.load(Ordering::Relaxed) {
            return Err(PipelineError::InterruptedIn(Stage::Load));
        }
        let mut finished = false;
        if let Some(Earlier {
            manifest: before,
            plan: planned,
        }) = earlier
        {
            let now = Belonging::new(plan.config(), &manifest)?;
            let then = Belonging::new(planned.config(), &before)?;
            then.refuse_changes(&now, &options.out)?;
            refuse_other_state(&now, &options.out)?;
            finished = before.status == Status::Finished;
            warn_of_other_programs(&before, &mut manifest, on_event);
            manifest.continue_from(before);
        }
        let (dir, lock) = RunDir::create(&options.out, options.existing)?;
        let mut session = Self {
            dir,
            plan,
            manifest,
            scene: prepared.scene,
            device,
            dense_points: Vec::new(),
            ray_chunk: None,
            finished,
            on_event,
            _lock: lock,
        };
        if !finished {
            session.begin(&options.config, prepared.detected)?;
        }
        Ok(session)
    }

    /// Writes what says what the run is.
    fn begin(&mut self, asked: &Config, detected: bool) -> Result<(), PipelineError> {
        self.set_damaged_aside()?;
        // Without a plan, what was asked would be taken for one.
        self.dir.write_plan(&self.plan)?;
        self.dir.write_config(asked)?;
        if detected {
            self.write_detections()?;
        }
        // The last of them: now the folder holds a run.
        self.write_manifest()
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
            let text = format!("{error}: {used} is used instead");
            self.warn(WarningKind::DamagedCheckpoint, text);
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
        let _span = tracing::info_span!("stage", %stage).entered();
        (self.on_event)(Event::StageStarted(stage));
        let start = Instant::now();
        let value = work(self)?;
        let seconds = start.elapsed().as_secs_f64();
        self.tell(Event::StageFinished { stage, seconds });
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

    pub fn warn(&mut self, kind: WarningKind, message: impl Into<String>) {
        self.tell(Event::Warning(Warning::new(kind, message)));
    }

    /// Tells an event, and keeps what of it has to last.
    pub fn tell(&mut self, event: Event<'_>) {
        self.manifest.record(&event);
        (self.on_event)(event);
    }

    pub fn written(&mut self, path: PathBuf) {
        tracing::debug!(path = %path.display(), "written");
        (self.on_event)(Event::FileWritten(path));
    }

    pub fn write_manifest(&mut self) -> Result<(), PipelineError> {
        self.manifest.updated = utc_now();
        Ok(self.dir.write_manifest(&self.manifest)?)
    }
}

/// The manifest of a run that begins now.
fn begun_now(
    options: &RunOptions,
    backend: Backend,
    device: &Device,
) -> Result<Manifest, PipelineError> {
    let now = utc_now();
    Ok(Manifest {
        neat: env!("CARGO_PKG_VERSION").to_owned(),
        compiler: env!("NEAT_RUSTC").to_owned(),
        target: env!("NEAT_TARGET").to_owned(),
        command_line: options.command_line.clone(),
        preset: options.preset.clone(),
        backend: backend.to_string(),
        device: gpu_name(device).unwrap_or_else(|| "CPU".to_owned()),
        threads: rayon::current_num_threads(),
        seed: options.seed,
        scene: absolute(&options.scene)?,
        sphere: None,
        inputs: BTreeMap::new(),
        decisions: Vec::new(),
        warnings: Vec::new(),
        status: Status::Running,
        steps: 0,
        started: now.clone(),
        updated: now,
        seconds: BTreeMap::new(),
    })
}

/// Reads the scene, settles what is open, and examines the scene of a new run.
fn prepare(
    options: &RunOptions,
    backend: Backend,
    earlier: Option<&Earlier>,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<(PreparedScene, Plan), PipelineError> {
    let memory_limit = options.memory_limit;
    let resources = Resources {
        cache: options.cache.as_ref(),
        memory_limit,
        cancelled: Some(cancelled),
    };
    let asked = &options.config;
    let scene_dir = absolute(&options.scene)?;
    let placed = earlier.and_then(|earlier| earlier.manifest.sphere.as_ref());
    let prepared = prepare_scene(&scene_dir, asked, placed, resources, on_event)?;
    let machine = Machine {
        backend,
        memory_limit,
    };
    let planned = earlier.map(|earlier| &earlier.plan);
    let (plan, decisions) = settle(asked, &prepared.scene, machine, planned)?;
    for decision in decisions {
        tracing::info!(%decision);
        on_event(Event::Decided(decision));
    }
    let changes = changes_of_presets(asked);
    let given = Given {
        sparse_points: !prepared.scene.sparse_points.is_empty(),
        detected: prepared.detected,
        trained: false,
    };
    for warning in settings_without_effect(&changes, &plan, given) {
        on_event(Event::Warning(warning));
    }
    if options.time_budget.is_some() && !plan.trains() {
        let text = format!("--time-budget has no effect: {NO_FIELD}");
        on_event(Event::Warning(Warning::new(WarningKind::NoEffect, text)));
    }
    if options.examine && earlier.is_none() {
        timed(on_event, Stage::Examine, |on_event| {
            examine_quickly(&prepared, &asked.data, memory_limit, on_event)
        })?;
    }
    Ok((prepared, plan))
}

/// Tells what computes if that was open, and what is wrong with it.
fn tell_of_device(options: &RunOptions, backend: Backend, device: &Device, on_event: OnEvent<'_>) {
    if options.backend == Backend::Auto {
        let reason = match gpu_name(device) {
            Some(name) => format!("as there is a GPU, {name}"),
            None if is_too_little_for_a_gpu(&options.config) => {
                "as a step is too little work for a GPU".to_owned()
            }
            None => "as there is no GPU".to_owned(),
        };
        on_event(Event::Decided(Decision {
            setting: "backend".to_owned(),
            value: backend.to_string(),
            reason,
        }));
    }
    if let Some(warning) = software_warning(device) {
        on_event(Event::Warning(warning));
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
        plan: dir.plan()?,
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
        let event = Event::Warning(Warning::new(WarningKind::OtherProgram, warning));
        now.record(&event);
        on_event(event);
    }
}

/// The path from the root, so that the manifest leads there from anywhere.
fn absolute(path: &Path) -> Result<PathBuf, SceneError> {
    std::path::absolute(path).map_err(|source| SceneError::Read {
        path: path.into(),
        source,
    })
}
