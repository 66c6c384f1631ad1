//! The whole method on a scene whose truth is known: synthesise, reconstruct,
//! evaluate.

use crate::error::LabError;
use neat_core::SceneError;
use neat_core::ground_truth::{GroundTruth, write_ground_truth};
use neat_core::layout::abc;
use neat_core::synthetic::{SyntheticScene, generate_on_demand};
use neat_eval::{CadFaces, EvaluationReport, FoundFace, NeatAbc, Scores, TrueFace};
use neat_pipeline::event::{Event, OnEvent, Stage, timed};
use neat_pipeline::reconstruct::{Reconstruction, RunOptions, reconstruct};
use neat_pipeline::run_dir::{Existing, RunDir};
use neat_wireframe::export::read_json;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The true wireframe in the folder of a synthetic scene.
pub const GROUND_TRUTH: &str = "gt_wireframe.json";

/// What a demonstration came to.
#[derive(Clone, Debug)]
pub struct Demo {
    /// What was reconstructed.
    pub reconstruction: Reconstruction,
    /// How good it is.
    pub evaluation: EvaluationReport,
    /// Where that is written, as JSON.
    pub evaluation_file: PathBuf,
}

/// Generates a synthetic scene and writes it in the ABC layout, with the true
/// wireframe, its curves and its faces as `gt_wireframe.json`.
///
/// # Errors
/// If the scene is impossible, or the folder is not empty or cannot be written.
pub fn synthesise(config: &SyntheticScene, dir: &Path) -> Result<GroundTruth, LabError> {
    config.validate()?;
    if dir
        .read_dir()
        .is_ok_and(|mut entries| entries.next().is_some())
    {
        return Err(LabError::SceneDirNotEmpty(dir.into()));
    }
    let data = generate_on_demand(config)?;
    let truth = GroundTruth {
        wireframe: data.truth,
        curves: data.solid.curves(),
    };
    abc::write_scene(&data.scene, dir)?;
    write_ground_truth(&dir.join(GROUND_TRUTH), &truth, &data.solid.true_faces())?;
    Ok(truth)
}

/// Synthesises a scene into `OUT/scene`, reconstructs it into `OUT/run`, and
/// writes how good the result is to `OUT/evaluation.json`. `options.scene` is
/// not looked at; `options.out` is OUT.
///
/// # Errors
/// As [`synthesise`] and [`reconstruct`].
pub fn demo(
    synthetic: &SyntheticScene,
    options: &RunOptions,
    cancelled: &AtomicBool,
    on_event: OnEvent<'_>,
) -> Result<Demo, LabError> {
    RunDir::check(&options.out, options.existing)?;
    if options.existing == Existing::Overwrite {
        remove_earlier_demo(&options.out)?;
    }
    let options = RunOptions {
        scene: options.out.join("scene"),
        out: options.out.join("run"),
        ..options.clone()
    };
    let evaluation_file = options.out.with_file_name("evaluation.json");
    let truth = timed(on_event, Stage::Synthesise, |_| {
        synthesise(synthetic, &options.scene)
    })?;
    let reconstruction = reconstruct(&options, cancelled, on_event)?;
    let evaluation = timed(on_event, Stage::Evaluate, |_| {
        let scores = scores(&reconstruction, &options.scene, &truth)?;
        Ok::<_, LabError>(EvaluationReport::new(scores))
    })?;
    evaluation.write_json(&evaluation_file)?;
    on_event(Event::FileWritten(evaluation_file.clone()));
    Ok(Demo {
        reconstruction,
        evaluation,
        evaluation_file,
    })
}

/// Edges by NEAT's own protocol, or where some are curves, of which that knows nothing, the faces.
fn scores(
    reconstruction: &Reconstruction,
    scene: &Path,
    truth: &GroundTruth,
) -> Result<Scores, LabError> {
    if truth.curves.is_empty() {
        let found = &reconstruction.wireframe;
        let scores = NeatAbc::default().evaluate(found, None, &truth.wireframe)?;
        return Ok(Scores::NeatAbc(scores));
    }
    let document = read_json(&reconstruction.run.wireframe("json"))?;
    let found = FoundFace::of_document(&document);
    let faces = TrueFace::read(&scene.join(GROUND_TRUTH))?;
    Ok(Scores::CadFaces(
        CadFaces::default().evaluate(&found, &faces)?,
    ))
}

/// Removes the scene of an earlier demonstration in `out`.
fn remove_earlier_demo(out: &Path) -> Result<(), LabError> {
    let scene = out.join("scene");
    if !scene.exists() {
        return Ok(());
    }
    // Without a run beside it, these may be somebody's photographs.
    RunDir::open(&out.join("run"))?;
    fs::remove_dir_all(&scene).map_err(|source| SceneError::Write {
        path: scene.clone(),
        source,
    })?;
    Ok(())
}
