//! Measures a result of any program by several protocols.
//!
//! ```text
//! cargo run --release -p neat-eval --example evaluate -- RESULT TRUTH [PROTOCOL…]
//! ```
//!
//! RESULT and TRUTH are `wireframe.json`, `parametric_edges.json` (RESULT only),
//! `.obj`, `.ply`, `.npz`, `.npy` or Line3D++'s `.txt`; without them a small
//! synthetic result is measured. PROTOCOL is one of `neat-abc`, `emap`,
//! `curve-gaussian`, `edge-gaussians`, `nef`, `hss` and `wed`.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nalgebra::Vector3;
use neat_core::Wireframe3d;
use neat_core::ground_truth::GroundTruth;
use neat_eval::{
    EdgeModel, EdgePoints, EditDistance, EvaluationReport, NeatAbc, Protocol, Scores,
    StructureScore, foreign,
};

type AnyError = Box<dyn std::error::Error>;

fn main() -> Result<(), AnyError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (predicted, truth) = match &arguments[..] {
        [result, truth, ..] => (
            foreign::read(result.as_ref())?,
            foreign::read_truth(truth.as_ref())?,
        ),
        _ => synthetic(),
    };
    let mut protocols = Vec::new();
    for name in arguments.iter().skip(2) {
        protocols.push(name.parse()?);
    }
    if protocols.is_empty() {
        protocols = vec![Protocol::NeatAbc, Protocol::Emap, Protocol::Wed];
    }
    for protocol in protocols {
        let report = EvaluationReport::new(measure(protocol, &predicted, &truth)?);
        println!("{}", report.to_text());
    }
    Ok(())
}

fn measure(
    protocol: Protocol,
    predicted: &EdgeModel,
    truth: &GroundTruth,
) -> Result<Scores, AnyError> {
    let (wireframe, true_wireframe) = (&predicted.wireframe, &truth.wireframe);
    Ok(match protocol {
        Protocol::NeatAbc => {
            Scores::NeatAbc(NeatAbc::default().evaluate(wireframe, None, true_wireframe)?)
        }
        Protocol::Emap => Scores::Emap(EdgePoints::emap().evaluate(predicted, truth)?),
        Protocol::CurveGaussian => {
            Scores::CurveGaussian(EdgePoints::curve_gaussian().evaluate(predicted, truth)?)
        }
        Protocol::EdgeGaussians => {
            Scores::EdgeGaussians(EdgePoints::edge_gaussians().evaluate(predicted, truth)?)
        }
        Protocol::Nef => Scores::Nef(EdgePoints::nef().evaluate(predicted, truth)?),
        Protocol::Hss => {
            Scores::Hss(StructureScore::default().evaluate(wireframe, true_wireframe)?)
        }
        Protocol::Wed => Scores::Wed(EditDistance::default().evaluate(wireframe, true_wireframe)?),
        other => return Err(format!("{other} needs a surface, which this example has not").into()),
    })
}

/// A square, and a result that lacks one of its edges.
fn synthetic() -> (EdgeModel, GroundTruth) {
    let wireframe = Wireframe3d {
        junctions: [[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]]
            .map(|[x, y]| Vector3::new(x, y, 0.5))
            .to_vec(),
        edges: vec![[0, 1], [1, 2], [2, 3], [3, 0]],
    };
    let mut predicted = wireframe.map(|p| p + Vector3::new(0.004, -0.003, 0.0));
    predicted.edges.pop();
    let truth = GroundTruth {
        wireframe,
        curves: Vec::new(),
    };
    (predicted.into(), truth)
}
