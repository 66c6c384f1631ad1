//! Which faces and solids are found in scenes with a truth: in the true wireframe, and in the one
//! that the assembler makes; of rendered photographs in the latter only.
//!
//! ```text
//! cargo run --release -p neat-eval --example measure_solids -- [--out DIR] [--kept DIR] [--planes] SCENE…
//! ```
//!
//! `--out` keeps documents with their shells, `NAME/true.json` and `NAME/assembled.json`. With
//! `--kept` wireframes and segments are those that `measure_assembler --out` has left there; a
//! scene that it lacks is measured in the true wireframe only. A true wireframe gets no views: only
//! its edges speak. Its curves that are no arcs of circles are splines.
//! Faces are measured by the protocols `cad-faces` and `scene-faces`. `--planes` lists the plane of
//! each large face of rendered photographs, with how far it is from that of the surface, and
//! measures faces once more with their corners moved onto their planes.

#![expect(clippy::print_stdout, reason = "it measures for people to read")]

mod planes;
#[path = "../measure_assembler/prepared.rs"]
mod prepared;
mod truth;

use nalgebra::{Matrix3, Vector3};
use neat_core::{Camera, CircularArc, Dome, Scene, Spline, Wireframe3d};
use neat_eval::{CadFaces, FaceShares, FoundFace, SceneFaceScores, SceneFaces, SceneTruth};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::AssembleConfig;
use neat_wireframe::confidence::{ConfidenceConfig, assess, transformed_covariance};
use neat_wireframe::export::{WireframeDocument, read_json, write_json};
use neat_wireframe::faces::{
    MeasuredGraph, Shell, ShellGeometry, SurfacePoint, find_shells, surface_points,
};
use prepared::{MIN_SEGMENT_SCORE, prepared};
use std::env;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;
use truth::Truth;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// A wireframe in the frame of the files, with what there is to find faces by.
struct Input {
    wireframe: Wireframe3d,
    arcs: Vec<CircularArc>,
    splines: Vec<Spline>,
    domes: Vec<Dome>,
    covariances: Vec<Option<Matrix3<f64>>>,
    views: Vec<ViewObservation>,
    points: Vec<SurfacePoint>,
}

fn main() -> Result<()> {
    let (mut scenes, mut out, mut kept, mut planes) = (Vec::new(), None, None, false);
    let mut arguments = env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--out" => out = arguments.next().map(PathBuf::from),
            "--kept" => kept = arguments.next().map(PathBuf::from),
            "--planes" => planes = true,
            _ => scenes.push(PathBuf::from(argument)),
        }
    }
    for dir in &scenes {
        let name = dir.file_name().unwrap_or_default().to_string_lossy();
        let folder = out.as_ref().map(|out| out.join(&*name));
        let keep = |kind: &str, input: &Input, shells: Vec<Shell>| -> Result<()> {
            if let Some(folder) = &folder {
                fs::create_dir_all(folder)?;
                let document = input.document(shells);
                write_json(&folder.join(format!("{kind}.json")), &document)?;
            }
            Ok(())
        };
        if dir.join("truth").exists() {
            if let Some(input) = reconstructed(dir, &name, kept.as_deref())? {
                let start = Instant::now();
                let shells = input.shells();
                let seconds = start.elapsed().as_secs_f64();
                let scores = scene_scores(&shells, &input, dir, planes)?;
                println!("{name}: {seconds:.3} s, {scores}");
                keep("assembled", &input, shells)?;
            }
            continue;
        }
        let truth = Truth::read(dir)?;
        let of_truth = Input {
            wireframe: truth.wireframe.clone(),
            arcs: truth.arcs.clone(),
            splines: truth.splines.clone(),
            domes: Vec::new(),
            covariances: Vec::new(),
            views: Vec::new(),
            points: Vec::new(),
        };
        println!(
            "{name}: {} edges, {} arcs, {} splines, {} faces",
            truth.wireframe.edges.len(),
            truth.arcs.len(),
            truth.splines.len(),
            truth.faces.len()
        );
        let measure = |kind: &str, input: &Input| -> Result<()> {
            let start = Instant::now();
            let shells = input.shells();
            let seconds = start.elapsed().as_secs_f64();
            println!(
                "  {kind:9} {}, {seconds:.3} s",
                scores(&shells, input, &truth)
            );
            keep(kind, input, shells)
        };
        measure("true", &of_truth)?;
        if let Some(input) = reconstructed(dir, &name, kept.as_deref())? {
            measure("assembled", &input)?;
        }
    }
    Ok(())
}

/// What the assembler makes of a scene, or has made of it; `None` if it is not among those kept.
fn reconstructed(dir: &Path, name: &str, kept: Option<&Path>) -> Result<Option<Input>> {
    let folder = kept.map(|kept| kept.join(name));
    if folder
        .as_ref()
        .is_some_and(|folder| !folder.join("wireframe.json").exists())
    {
        return Ok(None);
    }
    let mut scene = prepared(dir, folder.as_deref())?;
    let original = |scene: &Scene, p: &Vector3<f64>| scene.original_from_world.apply(p);
    let (wireframe, arcs, splines, domes) = match folder {
        Some(folder) => {
            let document = read_json(&folder.join("wireframe.json"))?;
            let world = scene.original_from_world.inverse();
            let wireframe = document.wireframe().map(|p| world.apply(p));
            (wireframe, document.arcs, document.splines, document.domes)
        }
        None => {
            let built = prepared::reconstructed(&scene, AssembleConfig::default().min_structure)?;
            if let Some(refined) = built.refined_scene {
                scene = refined;
            }
            let arcs = built
                .arcs
                .iter()
                .map(|arc| arc.map(|p| original(&scene, p)));
            let splines = (built.splines.iter()).map(|s| s.map(|p| original(&scene, p)));
            let domes = (built.domes.iter()).map(|d| d.map(|p| original(&scene, p)));
            let (arcs, splines) = (arcs.collect(), splines.collect());
            (built.wireframe, arcs, splines, domes.collect())
        }
    };
    let views = ViewObservation::from_scene(&scene, MIN_SEGMENT_SCORE);
    let confidence = assess(&wireframe, &views, None, 1.0, &ConfidenceConfig::default())?;
    let covariance =
        |covariance: &Matrix3<f64>| transformed_covariance(covariance, &scene.original_from_world);
    let in_original = |view: ViewObservation| ViewObservation {
        camera: Camera {
            center_in_world: original(&scene, &view.camera.center_in_world),
            ..view.camera
        },
        ..view
    };
    let views: Vec<_> = views.into_iter().map(in_original).collect();
    let cameras: Vec<_> = views.iter().map(|view| view.camera).collect();
    let mut points = scene.sparse_points.clone();
    for point in &mut points {
        point.position_in_world = original(&scene, &point.position_in_world);
    }
    Ok(Some(Input {
        wireframe: wireframe.map(|p| original(&scene, p)),
        arcs,
        splines,
        domes,
        covariances: (confidence.junctions.iter())
            .map(|junction| junction.covariance.as_ref().map(covariance))
            .collect(),
        points: surface_points(&cameras, &points),
        views,
    }))
}

impl Input {
    fn graph(&self) -> MeasuredGraph<'_> {
        MeasuredGraph {
            wireframe: &self.wireframe,
            arcs: &self.arcs,
            splines: &self.splines,
            domes: &self.domes,
            covariances: &self.covariances,
        }
    }

    fn shells(&self) -> Vec<Shell> {
        find_shells(&self.graph(), &self.views, &self.points)
    }

    fn document(&self, shells: Vec<Shell>) -> WireframeDocument {
        WireframeDocument {
            arcs: self.arcs.clone(),
            splines: self.splines.clone(),
            domes: self.domes.clone(),
            shells,
            ..WireframeDocument::from(&self.wireframe)
        }
    }
}

/// Faces, shells and agreement with the true faces, as text.
fn scores(shells: &[Shell], input: &Input, truth: &Truth) -> String {
    let mut text = format!(
        "{} faces",
        shells.iter().map(|shell| shell.faces.len()).sum::<usize>()
    );
    for shell in shells {
        let geometry = ShellGeometry::new(shell, &input.graph());
        let faces = shell.faces.len();
        text += &match (shell.closed, truth.volume) {
            (false, _) => format!(", sheet of {faces}"),
            (true, None) => format!(", closed of {faces}, volume {:.5}", geometry.volume(shell)),
            (true, Some(volume)) => {
                format!(
                    ", closed of {faces}, volume ratio {:.4}",
                    geometry.volume(shell) / volume
                )
            }
        };
    }
    if let Ok(found) = CadFaces::default().evaluate(&faces_of(shells, input), &truth.faces) {
        text += &format!(
            ", {:.3} of true area found, {:.3} of found area true",
            found.recall,
            found.precision.unwrap_or(0.0)
        );
    }
    text
}

/// The faces of a rendered scene against its surface, as text; on demand with each plane.
fn scene_scores(shells: &[Shell], input: &Input, dir: &Path, planes: bool) -> Result<String> {
    let truth = SceneTruth {
        cameras: input.views.iter().map(|view| view.camera).collect(),
        ..SceneTruth::read(dir)?
    };
    let faces = faces_of(shells, input);
    let scores = SceneFaces::default().evaluate(&faces, &truth)?;
    let mut text = format!(
        "{} faces of area {:.2}, {:.2} of planar surface seen, {} closed shells",
        scores.faces,
        scores.found_area,
        scores.planar_area,
        shells.iter().filter(|shell| shell.closed).count()
    );
    text += &shares_text(&scores);
    if planes {
        let flat: Vec<FoundFace> = faces.iter().map(planes::flattened).collect();
        let scores = SceneFaces::default().evaluate(&flat, &truth)?;
        text += &format!("\n  on their planes{}", shares_text(&scores));
        text += &planes::table(&faces, &truth)?;
    }
    Ok(text)
}

fn shares_text(scores: &SceneFaceScores) -> String {
    let of_threshold = |shares: &FaceShares| {
        format!(
            "; within {:.4}: precision {:.3}, recall {:.3}",
            shares.threshold,
            shares.precision.unwrap_or(0.0),
            shares.recall.unwrap_or(0.0)
        )
    };
    scores.thresholds.iter().map(of_threshold).collect()
}

fn faces_of(shells: &[Shell], input: &Input) -> Vec<FoundFace> {
    FoundFace::of_document(&input.document(shells.to_vec()))
}
