//! A scene folder → a 3D wireframe, by the assembler alone: no training. 2D wireframes
//! are detected where there are none.
//!
//! ```text
//! cargo run --release -p neat-lab --example assemble_scene -- SCENE \
//!     [--out DIR] [--overlays DIR] [--config FILE.json] [--truth gt_wireframe.json] \
//!     [--baseline]
//! ```
//!
//! With `--baseline` the segments of `line3d` instead: the plain method of the
//! paper's comparison, whose settings `--config` has then.
//!
//! Writes `wireframe.json`, `.obj` and `.ply` in the frame and the unit of the
//! scene's own files, and prints what each step kept, how long it took, and how
//! well the result agrees with the images and with the truth, if there is one.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

mod drawing;

use nalgebra::Vector3;
use neat_core::ground_truth::read_wireframe;
use neat_core::layout::HAWP_DIR;
use neat_core::{LoadOptions, Scene, load_scene};
use neat_detect::{DetectorConfig, detect_views, edgel_maps};
use neat_wireframe::ViewObservation;
use neat_wireframe::Wireframe3d;
use neat_wireframe::assemble::{
    AssembleConfig, Line3dConfig, assemble, line3d, wireframe_of_segments,
};
use neat_wireframe::confidence::{ConfidenceConfig, assess};
use neat_wireframe::export::{WireframeDocument, write_json, write_obj, write_ply};
use neat_wireframe::metrics::{
    ImageEvidenceConfig, PointCloud, SegmentDistance, image_evidence, junction_distances,
    precision_recall, segment_distances,
};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

type AnyError = Box<dyn std::error::Error>;

/// What the command line asks for.
#[derive(Default)]
struct Arguments {
    scene: PathBuf,
    out: Option<PathBuf>,
    overlays: Option<PathBuf>,
    config: Option<PathBuf>,
    truth: Option<PathBuf>,
    baseline: bool,
}

impl Arguments {
    fn parse() -> Result<Self, AnyError> {
        let mut parsed = Self::default();
        let mut arguments = std::env::args_os().skip(1);
        while let Some(argument) = arguments.next() {
            let option = match argument.to_str() {
                Some("--out") => &mut parsed.out,
                Some("--overlays") => &mut parsed.overlays,
                Some("--config") => &mut parsed.config,
                Some("--truth") => &mut parsed.truth,
                Some("--baseline") => {
                    parsed.baseline = true;
                    continue;
                }
                _ => {
                    parsed.scene = argument.into();
                    continue;
                }
            };
            let value = arguments.next().ok_or("the last option lacks its value")?;
            *option = Some(value.into());
        }
        if parsed.scene.as_os_str().is_empty() {
            return Err("name the folder of a scene".into());
        }
        Ok(parsed)
    }
}

fn main() -> Result<(), AnyError> {
    let arguments = Arguments::parse()?;
    let detected = !arguments.scene.join(HAWP_DIR).is_dir();
    let options = LoadOptions {
        require_wireframes: !detected,
        ..LoadOptions::default()
    };
    let loaded = load_scene(&arguments.scene, &options)?;
    for warning in &loaded.warnings {
        println!("warning: {warning}");
    }
    let mut scene = loaded.scene;
    if detected {
        detect_views(&mut scene, &DetectorConfig::default())?;
    }
    let observations = ViewObservation::from_scene(&scene, 0.05);

    let Reconstruction {
        wireframe,
        views_per_edge,
    } = if arguments.baseline {
        baseline(&arguments, &observations, scene.sphere_radius)?
    } else {
        assembled(&arguments, &scene, &observations)?
    };

    let points: Vec<_> = scene
        .sparse_points
        .iter()
        .map(|point| point.position_in_world)
        .collect();
    let evidence = image_evidence(
        &wireframe,
        &observations,
        &points,
        &ImageEvidenceConfig::default(),
    )?;
    println!("{}", serde_json::to_string_pretty(&evidence)?);
    println!(
        "explained share of segments: {:?}",
        evidence.explained_share()
    );
    print_graph(&wireframe, &points)?;
    println!(
        "scene radius {:.4}, unit of the files {:.4}",
        scene.sphere_radius, scene.original_from_world.scale
    );

    let in_files = wireframe.map(|junction| scene.original_from_world.apply(junction));
    if let Some(path) = &arguments.truth {
        let truth = read_wireframe(path)?;
        let junctions = junction_distances(&in_files.junctions, &truth.junctions)?;
        let (ours, true_ones) = (in_files.segments(), truth.segments());
        let segments = segment_distances(&ours, &true_ones, SegmentDistance::Max)?;
        for (name, distances) in [("junctions", junctions), ("segments", segments)] {
            for score in precision_recall(&distances, &[0.01, 0.02, 0.05])? {
                println!(
                    "{name:>12} within {}: precision {:.3}, recall {:.3}",
                    score.threshold, score.precision, score.recall
                );
            }
        }
    }
    if let Some(dir) = &arguments.out {
        std::fs::create_dir_all(dir)?;
        let mut document = WireframeDocument::from(&in_files);
        document.edge_fields.supporting_views = Some(views_per_edge.clone());
        write_json(&dir.join("wireframe.json"), &document)?;
        write_obj(&dir.join("wireframe.obj"), &in_files, &[])?;
        write_ply(&dir.join("wireframe.ply"), &in_files, &[])?;
    }
    if let Some(dir) = &arguments.overlays {
        drawing::draw_overlays(dir, &scene, &wireframe, &views_per_edge)?;
        drawing::draw_plans(dir, &wireframe)?;
    }
    Ok(())
}

/// A wireframe in the world of the cameras.
struct Reconstruction {
    wireframe: Wireframe3d,
    views_per_edge: Vec<usize>,
}

fn assembled(
    arguments: &Arguments,
    scene: &Scene,
    observations: &[ViewObservation],
) -> Result<Reconstruction, AnyError> {
    let config: AssembleConfig = read_config(arguments.config.as_deref())?;
    let start = Instant::now();
    let edgels = edgel_maps(&scene.views, &DetectorConfig::default(), scene.pixel_center)?;
    println!("{:>12} {:8.3} s", "edgels", start.elapsed().as_secs_f64());
    let radius = scene.sphere_radius;
    let result = assemble(observations, &edgels, radius, &config);
    println!("{:>12} {:8.3} s", "total", start.elapsed().as_secs_f64());
    println!("{}", serde_json::to_string_pretty(&result.report)?);
    let confidence = assess(
        &result.wireframe,
        observations,
        None,
        radius,
        &ConfidenceConfig::default(),
    )?;
    Ok(Reconstruction {
        views_per_edge: confidence.edges.iter().map(|edge| edge.views).collect(),
        wireframe: result.wireframe,
    })
}

fn baseline(
    arguments: &Arguments,
    observations: &[ViewObservation],
    scene_radius: f64,
) -> Result<Reconstruction, AnyError> {
    let config: Line3dConfig = read_config(arguments.config.as_deref())?;
    let start = Instant::now();
    let segments = line3d(observations, scene_radius, &config);
    let seconds = start.elapsed().as_secs_f64();
    println!("{} segments in {seconds:.3} s", segments.len());
    Ok(Reconstruction {
        wireframe: wireframe_of_segments(&segments),
        views_per_edge: segments.iter().map(|segment| segment.views).collect(),
    })
}

fn read_config<T: DeserializeOwned + Default>(path: Option<&Path>) -> Result<T, AnyError> {
    Ok(match path {
        Some(path) => serde_json::from_slice(&std::fs::read(path)?)?,
        None => T::default(),
    })
}

/// What kind of graph it is, and how far its junctions are from points on the
/// surfaces.
fn print_graph(wireframe: &Wireframe3d, points: &[Vector3<f64>]) -> Result<(), AnyError> {
    let mut degrees = vec![0; wireframe.junctions.len()];
    for junction in wireframe.edges.iter().flatten() {
        degrees[*junction] += 1;
    }
    let mut histogram: BTreeMap<usize, usize> = BTreeMap::new();
    for degree in degrees {
        *histogram.entry(degree).or_default() += 1;
    }
    let count = wireframe.junctions.len().max(1) as f64;
    let free = histogram.get(&1).copied().unwrap_or(0);
    println!(
        "mean degree {:.2}, free ends {:.1} %, junctions by degree {histogram:?}",
        2.0 * wireframe.edges.len() as f64 / count,
        100.0 * free as f64 / count,
    );
    let cloud = PointCloud::new(points)?;
    let mut distances: Vec<f64> = wireframe
        .junctions
        .iter()
        .filter_map(|junction| cloud.distance(junction))
        .collect();
    distances.sort_by(f64::total_cmp);
    for percent in [50, 90, 99] {
        if let Some(distance) = distances.get(distances.len() * percent / 100) {
            println!("{percent} % of the junctions within {distance:.5} of a point");
        }
    }
    Ok(())
}
