//! What the assembler makes of scenes, measured against the truth that each folder holds.
//!
//! ```text
//! cargo run --release -p neat-eval --example measure_assembler -- [--structure] [--reliability] [--every K,…] [--out DIR] SCENE…
//! ```
//!
//! No field, no run folder and, unless it is asked for, no confidence: the quickest way from a
//! changed line of the assembler to its scores. A scene with `gt_wireframe.json` is measured as
//! `scripts/measure_objects.py` does (neat-abc at 0.01, one to one; by length where there are
//! true curves, too), one with `truth/` as
//! `scripts/measure_photographs.py` does (surface-and-creases), one without truth by how much
//! of the 2D segments it explains. With `--out` the wireframes are kept, and so are the 2D
//! segments, which the next call takes from there. With `--structure` only edges are measured
//! that are rather creases or boundaries than texture or shadows, without it those that are not
//! surely the latter, as a run keeps them. With `--reliability` the
//! probabilities of the edges are held to the truth, too, and the weights are fitted from which
//! they would come: scenes of one folder are a class. With `--every 4,2,1` each scene is built of
//! every fourth view, of every second and of all; what `--out` keeps is of the last.

#![expect(clippy::print_stdout, reason = "it measures for people to read")]

mod calibration_weights;
mod prepared;
mod probabilities;

use neat_core::{Camera, Scene, View};
use neat_eval::{
    CubicBezier, EdgeModel, EdgePoints, EdgeSampling, EvaluationInput, EvaluationOptions, NeatAbc,
};
use neat_eval::{Protocol, SceneTruth, Scores, SurfaceAndCreases, foreign};
use neat_wireframe::assemble::AssembleConfig;
use neat_wireframe::export::{WireframeDocument, write_json};
use neat_wireframe::metrics::{ImageEvidenceConfig, Matching, PrecisionRecall, image_evidence};
use neat_wireframe::{ViewObservation, Wireframe3d};
use prepared::{MIN_SEGMENT_SCORE, prepared, reconstructed};
use probabilities::Probabilities;
use std::env;
use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let (mut scenes, mut out, mut structure) = (Vec::new(), None, false);
    let (mut probabilities, mut every) = (None, vec![1]);
    let mut arguments = env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--out" => out = arguments.next().map(PathBuf::from),
            "--structure" => structure = true,
            "--every" => {
                let list = arguments.next().unwrap_or_default();
                every = (list.split(',').map(str::parse)).collect::<std::result::Result<_, _>>()?;
            }
            "--reliability" => probabilities = Some(Probabilities::default()),
            _ => scenes.push(PathBuf::from(argument)),
        }
    }
    let mut scores = Vec::new();
    let parts = scenes
        .iter()
        .flat_map(|dir| every.iter().map(move |every| (dir, *every)));
    for (dir, every) in parts {
        let name = dir.file_name().unwrap_or_default().to_string_lossy();
        let kept = out.as_ref().map(|out| out.join(&*name));
        let mut scene = prepared(dir, kept.as_deref())?;
        scene.views = scene
            .views
            .into_iter()
            .step_by(usize::max(every, 1))
            .collect();
        let start = Instant::now();
        let least = if structure {
            0.5
        } else {
            AssembleConfig::default().min_structure
        };
        let built = reconstructed(&scene, least)?;
        if let Some(refined) = built.refined_scene.clone() {
            scene = refined;
        }
        let seconds = start.elapsed().as_secs_f64();
        let original = |p: &_| scene.original_from_world.apply(p);
        let wireframe = built.wireframe.map(original);
        let mut document = WireframeDocument::from(&wireframe);
        document.arcs = built.arcs.iter().map(|arc| arc.map(original)).collect();
        document.splines = built.splines.iter().map(|s| s.map(original)).collect();
        document.domes = built.domes.iter().map(|d| d.map(original)).collect();
        let (text, score) = measured(dir, &scene, &built.wireframe, &wireframe)?;
        let of_curves = curves(dir, &document)?;
        let of_edges = match &mut probabilities {
            Some(probabilities) => probabilities.add(dir, &scene, &built.wireframe)?,
            None => String::new(),
        };
        println!(
            "{name:18} {text} {} edges, {} arcs, {} splines, {} domes{of_curves}{of_edges} {seconds:.1} s",
            wireframe.edges.len(),
            document.arcs.len(),
            document.splines.len(),
            document.domes.len()
        );
        scores.extend(score);
        if let Some(kept) = &kept {
            write_json(&kept.join("wireframe.json"), &document)?;
        }
    }
    if !scores.is_empty() {
        let mean =
            |k: usize| scores.iter().map(|s: &[f64; 2]| s[k]).sum::<f64>() / scores.len() as f64;
        println!(
            "mean of {}: segments {:.3} junctions {:.3}",
            scores.len(),
            mean(0),
            mean(1)
        );
    }
    if let Some(probabilities) = probabilities {
        print!("{}", probabilities.table());
    }
    Ok(())
}

/// How much of the length of what was found lies within 0.01 of true edges and curves, and how
/// much of those of it, without arcs and splines and with them, where there are true curves.
fn curves(dir: &Path, document: &WireframeDocument) -> Result<String> {
    let truth = dir.join("gt_wireframe.json");
    if !truth.exists() {
        return Ok(String::new());
    }
    let truth = foreign::read_truth(&truth)?;
    if truth.curves.is_empty() {
        return Ok(String::new());
    }
    // True curves come in pieces of 0.005, of which only whole spacings count: a twenty-fifth may
    // be lost.
    let protocol = EdgePoints {
        prediction: EdgeSampling::Spacing(0.0002),
        truth: EdgeSampling::Spacing(0.0002),
        thresholds: vec![NeatAbc::default().thresholds[0]],
        ..EdgePoints::edge_gaussians()
    };
    let mut text = ", edges and curves".to_owned();
    let of_arcs = document.arcs.iter().flat_map(CubicBezier::of_arc);
    let of_splines = document.splines.iter().flat_map(CubicBezier::of_spline);
    for curves in [Vec::new(), of_arcs.chain(of_splines).collect()] {
        let found = EdgeModel {
            wireframe: document.wireframe(),
            curves,
        };
        let score = protocol.evaluate(&found, &truth)?.thresholds[0];
        write!(text, " {:.3}/{:.3}", score.precision, score.recall)?;
    }
    Ok(text)
}

/// The scores as text, and F of segments and of junctions where there is a true wireframe.
fn measured(
    dir: &Path,
    scene: &Scene,
    in_world: &Wireframe3d,
    wireframe: &Wireframe3d,
) -> Result<(String, Option<[f64; 2]>)> {
    if dir.join("truth").exists() {
        return Ok((creases(dir, scene, wireframe)?, None));
    }
    let truth = dir.join("gt_wireframe.json");
    if truth.exists() {
        let truth = foreign::read_truth(&truth)?;
        if truth.wireframe.edges.is_empty() {
            return Ok(("no straight edge,".to_owned(), None));
        }
        let input = EvaluationInput {
            predicted: wireframe.clone().into(),
            truth,
            ..EvaluationInput::default()
        };
        let options = EvaluationOptions {
            thresholds: Some(vec![NeatAbc::default().thresholds[0]]),
            matching: Some(Matching::PerThreshold),
            ..EvaluationOptions::default()
        };
        let Scores::NeatAbc(scores) = Protocol::NeatAbc.evaluate(&input, &options)? else {
            return Err("neat-abc has other scores".into());
        };
        let (s, j) = (
            &scores.wireframe.segments_max[0],
            &scores.wireframe.junctions[0],
        );
        let f = |score: &PrecisionRecall| f_score(score.precision, score.recall);
        let text = format!(
            "segments {:.3}/{:.3}/{:.3} junctions {:.3}/{:.3}/{:.3}",
            s.precision,
            s.recall,
            f(s),
            j.precision,
            j.recall,
            f(j)
        );
        return Ok((text, Some([f(s), f(j)])));
    }
    let views = ViewObservation::from_scene(scene, MIN_SEGMENT_SCORE);
    let points: Vec<_> = scene
        .sparse_points
        .iter()
        .map(|p| p.position_in_world)
        .collect();
    let evidence = image_evidence(in_world, &views, &points, &ImageEvidenceConfig::default())?;
    let distance = evidence.median_junction_to_point_distance;
    let text = format!(
        "explained {:.1} % of length, {:.2} px, points {:.4}, free ends {:.1} %",
        100.0 * evidence.explained_length_share.unwrap_or(0.0),
        evidence
            .mean_reprojection_error_in_pixels
            .unwrap_or(f64::NAN),
        distance.map_or(f64::NAN, |d| d * scene.original_from_world.scale),
        100.0 * free_ends(in_world),
    );
    Ok((text, None))
}

/// Precision, recall and F of creases at the thresholds of the protocol, and precision and
/// recall of junctions at the last of them.
fn creases(dir: &Path, scene: &Scene, wireframe: &Wireframe3d) -> Result<String> {
    let mut truth = SceneTruth::read(dir)?;
    if truth.edge_views.is_none() {
        let of_files = |view: &View| Camera {
            center_in_world: scene
                .original_from_world
                .apply(&view.camera.center_in_world),
            ..view.camera
        };
        truth.cameras = scene.views.iter().map(of_files).collect();
    }
    let scores = SurfaceAndCreases::default().evaluate(wireframe, &truth)?;
    let mut text = String::from("P/R/F");
    for row in &scores.thresholds {
        let (p, r) = (
            row.length_on_crease.unwrap_or(0.0),
            row.completeness.unwrap_or(0.0),
        );
        text += &format!(" {p:.3}/{r:.3}/{:.3}", f_score(p, r));
    }
    if let Some(last) = scores.thresholds.last() {
        let (p, r) = (last.junction_precision, last.junction_recall);
        text += &format!(" JP {:.3} JR {:.3}", p.unwrap_or(0.0), r.unwrap_or(0.0));
    }
    Ok(text)
}

/// Share of the junctions that belong to one edge only.
fn free_ends(wireframe: &Wireframe3d) -> f64 {
    let mut degree = vec![0_u32; wireframe.junctions.len()];
    for &junction in wireframe.edges.iter().flatten() {
        degree[junction] += 1;
    }
    degree.iter().filter(|d| **d == 1).count() as f64 / degree.len().max(1) as f64
}

fn f_score(precision: f64, recall: f64) -> f64 {
    let sum = precision + recall;
    if sum > 0.0 {
        2.0 * precision * recall / sum
    } else {
        0.0
    }
}
