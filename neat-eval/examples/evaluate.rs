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
    EdgeModel, EvaluationInput, EvaluationOptions, EvaluationReport, Protocol, foreign,
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
    let input = EvaluationInput {
        predicted,
        truth,
        ..EvaluationInput::default()
    };
    for protocol in protocols {
        let scores = protocol.evaluate(&input, &EvaluationOptions::default())?;
        println!("{}", EvaluationReport::new(scores).to_text());
    }
    Ok(())
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
