//! How often the 95 % intervals of `neat measure` hold the true lengths of edges, radii of arcs
//! and areas of faces.
//!
//! ```text
//! cargo run --release -p neat-eval --example measure_intervals -- [--out DIR] [--solids SEEDS] SCENE…
//! ```
//!
//! Scenes hold a `gt_wireframe.json` or a folder `truth`; 2D segments are taken from `--out` and
//! kept there, as by `measure_assembler`. `--solids` adds synthetic solids of so many seeds, with
//! 16, 32 and 64 views in turn, whose images are detected like photographs. Every scene goes the
//! way of `neat reconstruct`: assembled, assessed, made a document, measured.
//!
//! An edge belongs to a true one if both ends lie within a tolerance of its ends, the nearest
//! pairs first, one to one. The tolerance caps errors, so the table has half of it, the whole and
//! twice as much: where coverage falls with it, edges are paired that are not the same. Edges
//! with a free end, whose length ends where images stop telling, are counted apart.
//!
//! A true arc or circle is found by the nearest arc that runs along most of it within the
//! tolerance, whatever its radius. A true face is found as by the protocol `cad-faces`; errors of
//! areas are shares of them. Where a truth lists no faces, those of its solids are taken.

#![expect(clippy::print_stdout, reason = "it measures for people to read")]

mod areas;
mod coverage;
mod judged;
#[path = "../measure_assembler/prepared.rs"]
mod prepared;
mod radii;

use areas::{Areas, faces_of_solids};
use coverage::Coverage;
use nalgebra::Vector3;
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{CircularArc, Scene, Wireframe3d};
use neat_detect::{DetectorConfig, detect_views};
use neat_eval::{NeatAbc, SceneTruth, SurfaceAndCreases, TrueFace, foreign};
use neat_wireframe::assemble::AssembleConfig;
use neat_wireframe::export::WireframeDocument;
use prepared::{prepared, reconstructed};
use radii::Radii;
use serde::Deserialize;
use std::env;
use std::error::Error;
use std::path::{Path, PathBuf};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// What edges are held against.
struct Truth {
    wireframe: Wireframe3d,
    arcs: Vec<CircularArc>,
    faces: Vec<TrueFace>,
    /// In the unit of the files.
    tolerance: f64,
}

fn main() -> Result<()> {
    let (mut scenes, mut out, mut seeds) = (Vec::new(), None, 0_u64);
    let mut arguments = env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--out" => out = arguments.next().map(PathBuf::from),
            "--solids" => seeds = arguments.next().unwrap_or_default().parse()?,
            _ => scenes.push(PathBuf::from(argument)),
        }
    }
    let (mut coverage, mut radii) = (Coverage::default(), Radii::default());
    let mut areas = Areas::default();
    for dir in &scenes {
        let name = dir.file_name().unwrap_or_default().to_string_lossy();
        let scene = prepared(dir, out.as_ref().map(|out| out.join(&*name)).as_deref())?;
        let truth = true_edges(dir)?;
        let folder = dir.parent().and_then(Path::file_name).unwrap_or_default();
        let kind = match dir.join("truth").exists() {
            true => name,
            false => folder.to_string_lossy(),
        };
        let document = documented(&scene)?;
        coverage.add(&kind, &document, &truth.wireframe, truth.tolerance)?;
        radii.add(&kind, &document, &truth.arcs, truth.tolerance)?;
        areas.add(&kind, &document, &truth.faces)?;
    }
    for (seed, solid) in (0..seeds).flat_map(|seed| Solid::ALL.map(|solid| (seed, solid))) {
        let config = SyntheticScene {
            solid,
            seed,
            views: [16, 32, 64][usize::try_from(seed % 3)?],
            ..SyntheticScene::default()
        };
        let mut data = generate(&config)?;
        detect_views(&mut data.scene, &DetectorConfig::default())?;
        let tolerance = NeatAbc::default().thresholds[0];
        let document = documented(&data.scene)?;
        coverage.add("solids", &document, &data.truth, tolerance)?;
        radii.add("solids", &document, data.solid.arcs(), tolerance)?;
        areas.add(
            "solids",
            &document,
            &faces_of_solids(&data.truth, data.solid.arcs()),
        )?;
    }
    print!("{}{}{}", coverage.table(), radii.table(), areas.table());
    Ok(())
}

/// The straight edges whose ends are ends of the geometry, with the threshold of the protocol
/// that the scene is measured by.
fn true_edges(dir: &Path) -> Result<Truth> {
    if !dir.join("truth").exists() {
        let path = dir.join("gt_wireframe.json");
        let (wireframe, arcs) = (foreign::read_truth(&path)?.wireframe, true_arcs(&path)?);
        let listed = TrueFace::read(&path)?;
        return Ok(Truth {
            faces: match listed.is_empty() {
                true => faces_of_solids(&wireframe, &arcs),
                false => listed,
            },
            wireframe,
            arcs,
            tolerance: NeatAbc::default().thresholds[0],
        });
    }
    let SceneTruth {
        mut wireframe,
        cut_ends,
        scale,
        ..
    } = SceneTruth::read(dir)?;
    // Where an edge stops being seen, the truth depends on who looks.
    let is_cut = |junction: &usize| cut_ends.get(*junction).copied().unwrap_or(false);
    wireframe.edges.retain(|edge| !edge.iter().any(is_cut));
    Ok(Truth {
        wireframe,
        arcs: Vec::new(),
        faces: Vec::new(),
        tolerance: scale * SurfaceAndCreases::default().thresholds[1],
    })
}

/// The arcs and circles among the true curves, where these say what they are.
fn true_arcs(path: &Path) -> Result<Vec<CircularArc>> {
    #[derive(Deserialize)]
    struct Truth {
        #[serde(default)]
        curves: Vec<serde_json::Value>,
    }
    #[derive(Deserialize)]
    struct Circle {
        r#type: String,
        center: Vector3<f64>,
        axis: Vector3<f64>,
        x_axis: Vector3<f64>,
        radius: f64,
        start_angle: f64,
        end_angle: f64,
    }
    let truth: Truth = serde_json::from_slice(&std::fs::read(path)?)?;
    let circles = truth
        .curves
        .into_iter()
        .map(serde_json::from_value::<Circle>);
    Ok(circles
        .filter_map(std::result::Result::ok)
        .filter(|circle| ["arc", "circle"].contains(&&*circle.r#type))
        .map(|circle| CircularArc {
            center: circle.center,
            axes: [circle.x_axis, circle.axis.cross(&circle.x_axis)],
            radius: circle.radius,
            angles: [circle.start_angle, circle.end_angle],
        })
        .collect())
}

/// As a run would write it.
fn documented(scene: &Scene) -> Result<WireframeDocument> {
    let least = AssembleConfig::default().min_structure;
    Ok(reconstructed(scene, least)?.document(scene))
}
