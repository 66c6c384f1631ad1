//! From a scene to a run: the folder with all results.

use crate::background::{run, run_watched};
use crate::errors::Failure;
use crate::field::Field;
use crate::scene::{Scene, temporary};
use crate::settings;
use crate::wireframe::{Wireframe, from_json, warn};
use neat_core::MemoryLimit;
use neat_core::file_cache::FileCache;
use neat_pipeline::config::{Choice, Config, FieldUse, Preset, apply_overrides, contradicted};
use neat_pipeline::event::Event;
use neat_pipeline::reconstruct::{RunOptions, open_run, reconstruct as reconstruct_in};
use neat_pipeline::resources::{Resources, default_limit};
use neat_pipeline::run_dir::{Existing, RunDir, parse_config};
use neat_tensor::Backend;
use neat_wireframe::export::read_json;
use pyo3::prelude::*;
use serde_json::Value;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Of steps and shares of a stage, one is told in so much time.
const OFTEN: Duration = Duration::from_millis(50);

/// A run that has been: a folder with the wireframe, pictures, the report, and all that is
/// needed to repeat or continue it.
#[pyclass(frozen, module = "neat3d")]
pub struct Run {
    dir: RunDir,
    /// Temporary folders of the run and its scene.
    _keep: Vec<Py<PyAny>>,
}

#[pymethods]
impl Run {
    /// The run in a folder.
    #[new]
    fn new(folder: PathBuf) -> PyResult<Self> {
        let dir = RunDir::open(&folder).map_err(Failure::from)?;
        Ok(Self {
            dir,
            _keep: Vec::new(),
        })
    }

    /// Where it is. A temporary folder goes with the object.
    #[getter]
    fn folder(&self) -> PathBuf {
        self.dir.root().into()
    }

    /// The wireframe, in the frame and unit of your files.
    #[getter]
    fn wireframe(&self) -> PyResult<Wireframe> {
        Ok(read_json(&self.dir.wireframe("json"))
            .map_err(Failure::from)?
            .into())
    }

    /// report.html: the wireframe to turn, with the evidence for every edge. One file that
    /// needs no network.
    #[getter]
    fn report(&self) -> PathBuf {
        self.dir.report()
    }

    /// What ran, where, on which inputs, how long, and what it decided and warned of.
    #[getter]
    fn manifest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let manifest = self.dir.manifest().map_err(Failure::from)?;
        from_json(py, &serde_json::json!(manifest))
    }

    /// The field of the last checkpoint, if one was trained.
    ///
    /// scene: the folder of the scene, if it is not where the run found it.
    #[pyo3(signature = (scene=None, *, backend="auto", threads=None))]
    fn field(
        &self,
        py: Python<'_>,
        scene: Option<PathBuf>,
        backend: &str,
        threads: Option<usize>,
    ) -> PyResult<Field> {
        let backend: Backend = backend.parse().map_err(Failure::from)?;
        let folder = self.dir.root().to_owned();
        let opened = run(py, threads, move || {
            let cache = FileCache::of_user();
            let resources = Resources {
                cache: cache.as_ref(),
                memory_limit: default_limit(),
                cancelled: None,
            };
            let configure = Ok::<Config, neat_pipeline::error::PipelineError>;
            let opened = open_run(
                &folder,
                scene.as_deref(),
                backend,
                resources,
                configure,
                &mut |_| (),
            )?;
            opened.trained_field()?;
            Ok(opened)
        })?;
        Field::new(opened, threads)
    }

    fn __repr__(&self) -> String {
        format!("<neat3d.Run: {}>", self.dir.root().display())
    }
}

/// Turns a scene into a 3D wireframe, and writes all results.
///
/// scene: a `Scene`, or a folder. out: a new or empty folder for the run; a temporary one that goes
/// with the result by default. preset, config, settings, seed, backend, train, time_budget (seconds),
/// resume, overwrite, memory_limit (bytes): as the options of `neat reconstruct`. examine and cache:
/// False for its --no-doctor and --no-cache. threads: None for one per core; results do not depend on it.
/// progress: called with a dict for each event, those of `neat reconstruct --progress json`.
///
/// Other threads of Python go on meanwhile. Ctrl-C ends the run after its current step and raises
/// `Interrupted`; the same call with resume=True continues it. An exception of progress ends it likewise.
/// Warnings are told as `NeatWarning`; a wireframe that is empty is one of them.
#[pyfunction]
#[pyo3(signature = (scene, out=None, *, preset=None, config=None, settings=None, seed=None, threads=None, backend="auto", train=false, time_budget=None, resume=false, overwrite=false, examine=true, cache=true, memory_limit=None, progress=None))]
pub fn reconstruct(
    py: Python<'_>,
    scene: &Bound<'_, PyAny>,
    out: Option<PathBuf>,
    preset: Option<&str>,
    config: Option<PathBuf>,
    settings: Option<&Bound<'_, PyAny>>,
    seed: Option<u64>,
    threads: Option<usize>,
    backend: &str,
    train: bool,
    time_budget: Option<f64>,
    resume: bool,
    overwrite: bool,
    examine: bool,
    cache: bool,
    memory_limit: Option<u64>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Run> {
    let mut keep = Vec::new();
    let scene = scene_folder(scene, &mut keep)?;
    let existing = existing(resume, overwrite)?;
    let out = match out {
        Some(out) => out,
        None if resume => {
            let text = "resume=True continues a run: give its folder as out";
            return Err(Failure::input(text).into());
        }
        None => {
            let (folder, temporary) = temporary(py)?;
            keep.push(temporary);
            folder
        }
    };
    let method = Method {
        preset,
        config,
        settings: settings::overrides(settings)?,
    };
    let (mut config, preset, of_run) = method.of(&out, existing)?;
    if train {
        config = method.with_field(config)?;
    }
    let options = RunOptions {
        scene,
        out,
        existing,
        config,
        preset,
        backend: backend.parse().map_err(Failure::from)?,
        seed: seed.unwrap_or(of_run),
        time_budget: time_budget.map(duration).transpose()?,
        examine,
        cache: cache.then(FileCache::of_user).flatten(),
        memory_limit: memory_limit.map_or_else(default_limit, MemoryLimit::of_bytes),
        command_line: vec!["neat3d.reconstruct".to_owned()],
    };
    let reconstruction = run_watched(
        py,
        threads,
        |py, event: Value| tell(py, progress, &event),
        move |cancelled, events| {
            let mut told = None;
            Ok(reconstruct_in(&options, cancelled, &mut |event| {
                if is_worth_telling(&event, &mut told) {
                    // Nobody listens to a run that was left behind.
                    let _ = events.send(event.to_json());
                }
            })?)
        },
    )?;
    Ok(Run {
        dir: reconstruction.run,
        _keep: keep,
    })
}

/// The folder of a scene, and what must live as long as that is needed.
fn scene_folder(scene: &Bound<'_, PyAny>, keep: &mut Vec<Py<PyAny>>) -> PyResult<PathBuf> {
    let Ok(scene) = scene.cast::<Scene>() else {
        return scene.extract();
    };
    let (folder, temporary) = scene.get().place(scene.py());
    keep.extend(temporary);
    Ok(folder)
}

fn existing(resume: bool, overwrite: bool) -> Result<Existing, Failure> {
    match (resume, overwrite) {
        (true, true) => Err(Failure::input("resume and overwrite: give one of them")),
        (true, false) => Ok(Existing::Resume),
        (false, true) => Ok(Existing::Overwrite),
        (false, false) => Ok(Existing::Refuse),
    }
}

/// Hands an event to Python: warnings as warnings, all to who listens.
fn tell(py: Python<'_>, progress: Option<&Bound<'_, PyAny>>, event: &Value) -> PyResult<()> {
    if let (Some("warning"), Some(message)) = (event["event"].as_str(), event["message"].as_str()) {
        warn(py, message)?;
    }
    if let Some(progress) = progress {
        progress.call1((from_json(py, event)?,))?;
    }
    Ok(())
}

fn is_worth_telling(event: &Event<'_>, last: &mut Option<Instant>) -> bool {
    match event {
        Event::Step { fraction, .. } | Event::StageProgress { fraction, .. } if *fraction < 1.0 => {
            let is_soon = last.is_some_and(|last| last.elapsed() < OFTEN);
            if !is_soon {
                *last = Some(Instant::now());
            }
            !is_soon
        }
        _ => true,
    }
}

fn duration(seconds: f64) -> Result<Duration, Failure> {
    match Duration::try_from_secs_f64(seconds) {
        Ok(duration) if !duration.is_zero() => Ok(duration),
        _ => Err(Failure::input(format!(
            "time_budget is {seconds}: give seconds above 0"
        ))),
    }
}

/// What a configuration starts from, and what is changed of it.
struct Method<'a> {
    preset: Option<&'a str>,
    config: Option<PathBuf>,
    settings: Vec<String>,
}

impl Method<'_> {
    /// The configuration, its name, and the seed where none is given. What is not said again to a
    /// run that is continued stays.
    fn of(
        &self,
        out: &std::path::Path,
        existing: Existing,
    ) -> Result<(Config, String, u64), Failure> {
        let earlier = match existing {
            Existing::Resume => RunDir::to_resume(out)?,
            Existing::Refuse | Existing::Overwrite => None,
        };
        let (base, name) = match (self.preset, &self.config) {
            (Some(_), Some(_)) => {
                return Err(Failure::input("preset and config: give one of them"));
            }
            (Some(name), None) => {
                let preset: Preset = name.parse().map_err(Failure::input)?;
                (preset.config(), preset.to_string())
            }
            (None, Some(path)) => (parse_config(path)?, path.display().to_string()),
            (None, None) => match &earlier {
                Some(run) => (run.config()?, String::new()),
                None => (Preset::default().config(), Preset::default().to_string()),
            },
        };
        let config = apply_overrides(&base, &self.settings)?;
        Ok(match earlier {
            Some(run) => {
                let manifest = run.manifest()?;
                (config, manifest.preset, manifest.seed)
            }
            None => (config, name, 0),
        })
    }

    /// `config` with a field, as `train` says.
    fn with_field(&self, mut config: Config) -> Result<Config, Failure> {
        config.distill.field = Choice::Given(FieldUse::Trained);
        match contradicted(&config, &self.settings)? {
            Some(set) => Err(Failure::input(format!(
                "train and the setting {set}: give one of them"
            ))),
            None => Ok(config),
        }
    }
}
