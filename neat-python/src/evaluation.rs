//! A wireframe measured by published protocols.

use crate::arrays::points as points_of;
use crate::background::run;
use crate::errors::Failure;
use crate::wireframe::{Wireframe, from_json};
use neat_core::Wireframe3d;
use neat_core::ground_truth::GroundTruth;
use neat_core::ply::read_points;
use neat_eval::{
    EdgeModel, EvalError, EvaluationInput, EvaluationOptions, EvaluationReport, Protocol,
    SceneTruth, TruthKind, foreign,
};
use pyo3::prelude::*;
use serde_json::Value;
use std::path::PathBuf;

/// Edges that were given as an object, or by a file in any format of `neat eval`.
enum Edges {
    Object(Wireframe3d),
    File(PathBuf),
}

impl Edges {
    fn of(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(match object.cast::<Wireframe>() {
            Ok(wireframe) => Self::Object(wireframe.get().document.wireframe()),
            Err(_) => Self::File(object.extract()?),
        })
    }

    fn predicted(self) -> Result<EdgeModel, EvalError> {
        match self {
            Self::Object(wireframe) => Ok(wireframe.into()),
            Self::File(path) => foreign::read(&path),
        }
    }

    fn truth(self) -> Result<GroundTruth, EvalError> {
        match self {
            Self::Object(wireframe) => Ok(GroundTruth {
                wireframe,
                curves: Vec::new(),
            }),
            Self::File(path) => foreign::read_truth(&path),
        }
    }
}

/// Measures a wireframe by published protocols, as `neat eval` does with its defaults, and
/// returns one dict per protocol: `protocol`, `scores` and `source`.
///
/// predicted, truth: a `Wireframe`, or a file. points: on the true surface, (N, 3) or a PLY file.
/// scene: the folder of a rendered scene with its exact truth. protocols: names; without them a true wireframe
/// asks for neat-abc, points for neat-blended-mvs, a scene for surface-and-creases. Everything is in one frame and unit.
#[pyfunction]
#[pyo3(signature = (predicted, truth=None, *, points=None, scene=None, protocols=None, threads=None))]
pub fn evaluate<'py>(
    py: Python<'py>,
    predicted: &Bound<'py, PyAny>,
    truth: Option<&Bound<'py, PyAny>>,
    points: Option<&Bound<'py, PyAny>>,
    scene: Option<PathBuf>,
    protocols: Option<Vec<String>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let given = [
        (
            TruthKind::Edges,
            "truth",
            truth.is_some(),
            Protocol::NeatAbc,
        ),
        (
            TruthKind::SurfacePoints,
            "points",
            points.is_some(),
            Protocol::NeatBlendedMvs,
        ),
        (
            TruthKind::Scene,
            "scene",
            scene.is_some(),
            Protocol::SurfaceAndCreases,
        ),
    ];
    let protocols = match protocols {
        Some(names) => (names.iter().map(|name| name.parse::<Protocol>()))
            .collect::<Result<Vec<_>, _>>()
            .map_err(Failure::input)?,
        None => {
            let suggested = |(_, _, is_given, protocol)| bool::then_some(is_given, protocol);
            given.into_iter().filter_map(suggested).collect()
        }
    };
    check(&protocols, &given)?;
    let points = match points {
        None => Vec::new(),
        Some(object) => match object.extract::<PathBuf>() {
            Ok(path) => read_points(&path).map_err(Failure::from)?,
            Err(_) => points_of(object, "points")?,
        },
    };
    let (predicted, truth) = (Edges::of(predicted)?, truth.map(Edges::of).transpose()?);
    let reports = run(py, threads, move || {
        let mut input = EvaluationInput {
            predicted: predicted.predicted()?,
            truth: truth.map(Edges::truth).transpose()?.unwrap_or_default(),
            scene: scene
                .as_deref()
                .map(SceneTruth::read)
                .transpose()?
                .unwrap_or_default(),
            ..EvaluationInput::default()
        };
        input.surface.points = points;
        let measure = |protocol: &Protocol| -> Result<Value, EvalError> {
            let scores = protocol.evaluate(&input, &EvaluationOptions::default())?;
            Ok(serde_json::json!(EvaluationReport::new(scores)))
        };
        Ok(protocols
            .iter()
            .map(measure)
            .collect::<Result<Vec<_>, _>>()?)
    })?;
    from_json(py, &Value::Array(reports))
}

/// Refuses what is missing, and what no protocol would look at.
fn check(
    protocols: &[Protocol],
    given: &[(TruthKind, &str, bool, Protocol)],
) -> Result<(), Failure> {
    if protocols.is_empty() {
        return Err(Failure::input(
            "nothing to measure against: give truth, points or scene",
        ));
    }
    if protocols.contains(&Protocol::NeatDtu) {
        let text = "neat-dtu needs an observation mask and a plane: use `neat eval`; neat-blended-mvs does without";
        return Err(Failure::input(text));
    }
    let of_faces = [Protocol::CadFaces, Protocol::SceneFaces];
    if let Some(protocol) = protocols.iter().find(|p| of_faces.contains(p)) {
        return Err(Failure::input(format!(
            "{protocol} needs the faces of a file: use `neat eval`"
        )));
    }
    for (kind, name, is_given, _) in given {
        let asks = protocols.iter().find(|protocol| protocol.truth() == *kind);
        match asks {
            Some(protocol) if !is_given => {
                return Err(Failure::input(format!("{protocol} needs {name}: give it")));
            }
            None if *is_given => {
                let names: Vec<&str> = protocols.iter().map(|p| p.name()).collect();
                let names = names.join(", ");
                return Err(Failure::input(format!("{name} has no meaning for {names}")));
            }
            _ => {}
        }
    }
    Ok(())
}
