//! Reports on a synthetic scene, to look at and for `scripts/check_report.mjs`.
//!
//! ```text
//! cargo run --release -p neat-report --example sample_report -- FOLDER
//! ```
//!
//! `sample.html` has everything that a report can hold. In `hostile.html` all texts
//! would be markup or script if the page took them for that, and there are no
//! photographs. In `empty.html` nothing was reconstructed.

use nalgebra::Vector3;
use neat_core::synthetic::{Solid, SyntheticData, SyntheticScene, generate};
use neat_core::{LineSegment2, file};
use neat_report::{Curve, FactGroup, JunctionSnapshot, PhotographConfig, Report, ReportError};
use neat_wireframe::export::{EdgeFields, JunctionFields, SupportingSegment, WireframeDocument};
use neat_wireframe::faces::{MeasuredGraph, find_shells};
use std::error::Error;
use std::path::PathBuf;

const STEPS: u64 = 1000;
const HOSTILE: &str = "</script><img src=x onerror=alert(1)></title><!-- {{data}} ${1} \u{2028} \u{1b} \"'&lt; &amp; \\u003c";

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os()
        .nth(1)
        .ok_or("name the folder to write to")?;
    let folder = PathBuf::from(folder);
    file::create_dir(&folder)?;
    let data = generate(&SyntheticScene {
        solid: Solid::StairPrism,
        views: 24,
        image_size: 640,
        ..SyntheticScene::default()
    })?;
    let sample = sample(&data)?;
    sample.write(&folder.join("sample.html"))?;
    hostile(&sample).write(&folder.join("hostile.html"))?;
    empty(&sample).write(&folder.join("empty.html"))?;
    Ok(())
}

fn sample(data: &SyntheticData) -> Result<Report, ReportError> {
    let photographs = PhotographConfig {
        max_photographs: 16,
        ..PhotographConfig::default()
    };
    let mut report = Report::of_scene(&data.scene, document(data), 0.05, &photographs)?;
    report.junction_evolution = evolution(&report.document.junctions);
    report.curves = curves();
    report.facts = facts();
    report.warnings = vec![
        "Views 0003 and 0017 look alike: one of them adds little.".to_owned(),
        "Two segments are supported by no view.".to_owned(),
    ];
    report.configuration =
        "seed = 0\n\n[train]\nsteps = 1000\nrays = 1024\n\n[distill]\nmin_views = 2\n".to_owned();
    Ok(report)
}

fn hostile(sample: &Report) -> Report {
    let text = || HOSTILE.to_owned();
    let mut report = sample.clone();
    report.title = text();
    report.configuration = text();
    report.warnings = vec![text()];
    report.curves[0].name = text();
    report.facts[0].heading = text();
    report.facts[0].facts[0] = (text(), text());
    report.views[0].name = text();
    report.document.views[0] = text();
    for view in &mut report.views {
        view.photograph = None;
    }
    let fields = &mut report.document.edge_fields;
    let values = fields.probability.clone().unwrap_or_default();
    // Names that objects of JavaScript have already.
    for name in [text(), "__proto__".to_owned(), "constructor".to_owned()] {
        fields.other.insert(name, values.clone());
    }
    report
}

fn empty(sample: &Report) -> Report {
    Report {
        title: sample.title.clone(),
        views: sample.views[..1].to_vec(),
        warnings: vec!["the wireframe has no edges".to_owned()],
        ..Report::default()
    }
}

/// The truth, slightly moved, with two edges too many and what the 2D segments say.
fn document(data: &SyntheticData) -> WireframeDocument {
    let views = &data.scene.views;
    let graph = MeasuredGraph::of(&data.truth);
    let shells = find_shells(&graph, &[], &[]);
    let mut wireframe = data.truth.clone();
    for (index, junction) in wireframe.junctions.iter_mut().enumerate() {
        *junction += wave(index as f64) * 0.002;
    }
    let last = wireframe.junctions.len() - 1;
    wireframe.edges.extend([[0, last], [1, last / 2]]);

    let support: Vec<Vec<SupportingSegment>> = (0..wireframe.edges.len())
        .map(|edge| {
            let ends = wireframe.edges[edge].map(|end| wireframe.junctions[end]);
            let seen = views.iter().enumerate().flat_map(|(index, view)| {
                let sources = data.view_truths[index].sources.iter().enumerate();
                let visible = &data.view_truths[index].visible;
                let of_edge = move |(_, source): &(usize, &Option<usize>)| {
                    source.is_some_and(|part| visible[part].edge == edge)
                };
                let segments = view.wireframe.segments(0.05);
                sources.filter(of_edge).filter_map(move |(found, _)| {
                    let scored = segments.iter().find(|scored| scored.edge == found)?;
                    let [start, end] = ends.map(|end| view.camera.project(&end).pixel);
                    let projected = LineSegment2::new(start, end);
                    let observed = projected.with_nearest_order(&scored.segment);
                    Some(SupportingSegment {
                        view: index,
                        segment: [
                            observed.start.x,
                            observed.start.y,
                            observed.end.x,
                            observed.end.y,
                        ],
                        residual: residual(&projected, &observed),
                    })
                })
            });
            seen.collect()
        })
        .collect();

    let counts: Vec<usize> = support.iter().map(Vec::len).collect();
    let probability = counts
        .iter()
        .map(|n| 1.0 - (-0.33 * *n as f64).exp() * 0.95);
    let sigmas = (0..wireframe.junctions.len()).map(|i| 0.001 + 0.0008 * wave(i as f64).x.abs());
    WireframeDocument {
        edge_fields: EdgeFields {
            probability: Some(probability.collect()),
            supporting_views: Some(counts),
            ..EdgeFields::default()
        },
        junction_fields: JunctionFields {
            sigma: Some(sigmas.collect()),
            ..JunctionFields::default()
        },
        views: views.iter().map(|view| view.name.clone()).collect(),
        edge_support: support,
        shells,
        ..WireframeDocument::from(&wireframe)
    }
}

/// Root mean square distance of the ends of `observed` from the line of `projected`.
fn residual(projected: &LineSegment2, observed: &LineSegment2) -> f64 {
    let squared = observed.ends().map(|end| {
        let foot = projected.point_at(projected.line_parameter(&end));
        (end - foot).norm_squared()
    });
    ((squared[0] + squared[1]) / 2.0).sqrt()
}

/// A vector that looks like chance and is always the same.
fn wave(seed: f64) -> Vector3<f64> {
    Vector3::new(
        (12.9 * seed).sin(),
        (7.3 * seed + 1.0).sin(),
        (3.7 * seed + 2.0).sin(),
    )
}

/// Junctions that come from all over the scene and find their places.
fn evolution(junctions: &[Vector3<f64>]) -> Vec<JunctionSnapshot> {
    (0..=40)
        .map(|snapshot| {
            let t = f64::from(snapshot) / 40.0;
            let away = (-6.0 * t).exp() - (-6.0_f64).exp();
            let moved: Vec<_> = (junctions.iter().enumerate())
                .map(|(index, junction)| junction + wave(index as f64 + 0.3) * away)
                .collect();
            JunctionSnapshot::new((t * STEPS as f64) as u64, &moved)
        })
        .collect()
}

fn curves() -> Vec<Curve> {
    let curve = |name: &str, begin: f64, end: f64, seed: f64| Curve {
        name: name.to_owned(),
        points: (0..=200)
            .map(|i| {
                let t = f64::from(i) / 200.0;
                let noise = 1.0 + 0.12 * wave(seed + f64::from(i)).x;
                let value = (end + (begin - end) * (-7.0 * t).exp()) * noise;
                (i as u64 * STEPS / 200, value)
            })
            .collect(),
    };
    vec![
        curve("Total loss", 1.9, 0.021, 0.0),
        curve("Colour", 0.31, 0.012, 1.0),
        curve("Segment error in pixels", 48.0, 0.6, 2.0),
        curve("Junction", 0.8, 0.15, 3.0),
    ]
}

fn facts() -> Vec<FactGroup> {
    let group = |heading: &str, facts: &[(&str, &str)]| FactGroup {
        heading: heading.to_owned(),
        facts: (facts.iter())
            .map(|(label, value)| ((*label).to_owned(), (*value).to_owned()))
            .collect(),
    };
    vec![
        group(
            "Run",
            &[
                ("Preset", "fast"),
                ("Device", "flex, 2 threads"),
                ("Seed", "0"),
                ("Steps", "1000"),
            ],
        ),
        group(
            "Seconds",
            &[("Load", "0.4"), ("Train", "8.9"), ("Distil", "0.7")],
        ),
    ]
}
