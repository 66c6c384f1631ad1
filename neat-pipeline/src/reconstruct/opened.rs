//! Runs that have been, opened again.

use super::backend_choice::backend_for;
use crate::config::{Config, differences};
use crate::error::PipelineError;
use crate::event::{Event, OnEvent, Warning, WarningKind};
use crate::manifest::Manifest;
use crate::plan::{Given, Machine, Plan, settings_without_effect, settle};
use crate::resources::Resources;
use crate::run_dir::{RunDir, RunDirError};
use crate::scene::prepare_scene;
use burn::tensor::Device;
use neat_core::Scene;
use neat_tensor::backend::software_driver;
use neat_tensor::{Backend, Kernels};
use neat_train::TrainedField;
use std::path::Path;

/// A run that has been, with its scene and, if it was trained, its field.
#[derive(Debug)]
pub struct OpenedRun {
    /// Its folder.
    pub dir: RunDir,
    /// What was asked for.
    pub asked: Config,
    /// What was settled.
    pub plan: Plan,
    /// Its manifest.
    pub manifest: Manifest,
    /// Its scene.
    pub scene: Scene,
    /// What computes.
    pub device: Device,
    /// The field of its last checkpoint; `None` if it was not trained.
    pub field: Option<TrainedField>,
    machine: Machine,
}

impl OpenedRun {
    /// The field of the last checkpoint.
    ///
    /// # Errors
    /// If the run was not trained.
    pub fn trained_field(&self) -> Result<&TrainedField, PipelineError> {
        let no_field = || RunDirError::NoField(self.dir.root().into());
        Ok(self.field.as_ref().ok_or_else(no_field)?)
    }

    /// The plan for something else that is asked of this run. What its scene has decided
    /// stays.
    ///
    /// # Errors
    /// If what is asked for contradicts itself.
    pub fn replan(&self, asked: &Config) -> Result<Plan, PipelineError> {
        Ok(settle(asked, &self.scene, self.machine, Some(&self.plan))?.0)
    }
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
    let then = dir.config().map_err(PipelineError::from)?;
    let asked = configure(then.clone())?;
    Ok(read_run(
        dir, &then, asked, scene, backend, resources, on_event,
    )?)
}

fn read_run(
    dir: RunDir,
    then: &Config,
    asked: Config,
    scene: Option<&Path>,
    backend: Backend,
    resources: Resources<'_>,
    on_event: OnEvent<'_>,
) -> Result<OpenedRun, PipelineError> {
    let usable = dir.usable_checkpoint()?;
    let backend = match usable {
        Some(_) => backend_for(backend, &asked),
        None => backend.resolve_on_host(),
    };
    let device = backend.device()?;
    if let Some(warning) = software_warning(&device) {
        on_event(Event::Warning(warning));
    }
    let manifest = dir.manifest()?;
    let planned = dir.plan()?;
    let scene_dir = scene.unwrap_or(&manifest.scene);
    let placed = manifest.sphere.as_ref();
    let prepared = prepare_scene(scene_dir, &asked, placed, resources, on_event)?;
    let machine = Machine {
        backend,
        memory_limit: resources.memory_limit,
    };
    let (plan, _) = settle(&asked, &prepared.scene, machine, Some(&planned))?;
    let changes = differences(then, &asked);
    let given = Given {
        sparse_points: !prepared.scene.sparse_points.is_empty(),
        detected: prepared.detected,
        trained: usable.is_some(),
    };
    for warning in settings_without_effect(&changes, &plan, given) {
        on_event(Event::Warning(warning));
    }
    let field = match usable {
        Some(usable) => {
            for (_, error) in &usable.damaged {
                let text = format!("{error}: {} is used instead", usable.path.display());
                let warning = Warning::new(WarningKind::DamagedCheckpoint, text);
                on_event(Event::Warning(warning));
            }
            let kernels = Kernels::within(resources.memory_limit.bytes());
            let training = plan.config().training(kernels);
            Some(TrainedField::load(&training, &usable.checkpoint, &device)?)
        }
        None if plan.trains() => return Err(RunDirError::NoField(dir.root().into()).into()),
        None => None,
    };
    Ok(OpenedRun {
        dir,
        asked,
        plan,
        manifest,
        scene: prepared.scene,
        device,
        field,
        machine,
    })
}

/// What a person should know who computes through a software driver.
pub fn software_warning(device: &Device) -> Option<Warning> {
    let driver = software_driver(device)?;
    let text = format!(
        "{driver} is a software driver, not a GPU: right but slow; `--backend flex` is many times faster"
    );
    Some(Warning::new(WarningKind::SoftwareDriver, text))
}
