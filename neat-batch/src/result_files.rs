//! What a finished run says of its result.

use crate::error::BatchError;
use crate::job_record::JobState;
use crate::json_file;
use neat_core::ground_truth::{parse, read_wireframe};
use neat_core::{SceneError, file};
use neat_eval::{NeatAbc, NeatAbcScores};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

const REMEDY: &str = "run the job again";

/// Figures of one result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResultFigures {
    /// Number of junctions.
    pub junctions: usize,
    /// Number of edges.
    pub edges: usize,
    /// Share of the length of all 2D segments that edges explain; `None` without 2D
    /// segments.
    pub explained_length_share: Option<f64>,
    /// How far the ends of explained segments lie from the best edge's line, in
    /// pixels.
    pub mean_reprojection_error_in_pixels: Option<f64>,
    /// Optimisation steps.
    pub steps: u64,
    /// What computed.
    pub backend: String,
    /// What was noticed on the way.
    pub warnings: Vec<String>,
    /// Agreement with the true wireframe, by the protocol `neat-abc`, where there is
    /// one.
    pub evaluation: Option<NeatAbcScores>,
}

/// The part of `wireframe.json` beside the wireframe itself.
#[derive(Deserialize)]
struct Document {
    #[serde(default)]
    metadata: Metadata,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Metadata {
    agreement: Option<Agreement>,
}

#[derive(Deserialize)]
struct Agreement {
    explained_length_share: Option<f64>,
    mean_reprojection_error_in_pixels: Option<f64>,
}

/// The part of a run's `manifest.json` that a summary shows.
#[derive(Deserialize)]
struct RunManifest {
    backend: String,
    steps: u64,
    warnings: Vec<RunWarning>,
    /// In its words, which are those of jobs.
    status: JobState,
    /// Of each stage.
    seconds: BTreeMap<String, f64>,
}

/// Earlier versions of neat stored the message alone.
#[derive(Deserialize)]
#[serde(untagged)]
enum RunWarning {
    Message(String),
    Warning { message: String },
}

impl RunWarning {
    fn message(self) -> String {
        match self {
            Self::Message(message) | Self::Warning { message } => message,
        }
    }
}

/// The state and the seconds of a run that no batch has made, but `neat reconstruct`
/// itself; pending if there is none.
///
/// # Errors
/// If its `manifest.json` cannot be read or understood.
pub fn read_state(run: &Path) -> Result<(JobState, f64), SceneError> {
    let manifest = match read_manifest(run) {
        Err(SceneError::Missing { .. }) => return Ok((JobState::Pending, 0.0)),
        manifest => manifest?,
    };
    let state = match manifest.status {
        // Nobody works on it: it was killed.
        JobState::Running => JobState::Interrupted,
        state => state,
    };
    Ok((state, manifest.seconds.values().sum()))
}

fn read_manifest(run: &Path) -> Result<RunManifest, SceneError> {
    let path = run.join("manifest.json");
    json_file::parse(&file::read(&path, REMEDY)?, &path, "manifest of a run")
}

/// Reads the figures of a run from its `wireframe.json` and `manifest.json`, and
/// measures its wireframe with a true one, if there is one.
///
/// # Errors
/// If one of the files cannot be read or understood, or a wireframe is not valid.
pub fn read_result(run: &Path, truth: Option<&Path>) -> Result<ResultFigures, BatchError> {
    let path = run.join("wireframe.json");
    let bytes = file::read(&path, REMEDY)?;
    let wireframe = parse(&bytes, &path)?.wireframe;
    let document: Document = json_file::parse(&bytes, &path, "3D wireframe")?;
    let manifest = read_manifest(run)?;
    let agreement = document.metadata.agreement.as_ref();
    let evaluation = match truth {
        Some(path) => {
            let scores = NeatAbc::default().evaluate(&wireframe, None, &read_wireframe(path)?);
            Some(scores.map_err(|error| SceneError::Malformed {
                path: path.into(),
                reason: format!("it cannot be compared with the result: {error}"),
            })?)
        }
        None => None,
    };
    Ok(ResultFigures {
        junctions: wireframe.junctions.len(),
        edges: wireframe.edges.len(),
        explained_length_share: agreement.and_then(|a| a.explained_length_share),
        mean_reprojection_error_in_pixels: agreement
            .and_then(|a| a.mean_reprojection_error_in_pixels),
        steps: manifest.steps,
        backend: manifest.backend,
        warnings: (manifest.warnings.into_iter())
            .map(RunWarning::message)
            .collect(),
        evaluation,
    })
}
