//! A scene to its wireframe and its report.

use crate::listener::Listener;
use neat_core::{Scene, file};
use neat_detect::DetectorConfig;
use neat_images::assemble::{AssembleError, assemble_images};
use neat_images::config::DataConfig;
use neat_images::distilled::{Distilled, agreement, result_facts};
use neat_images::error::ImagesError;
use neat_images::event::{Event, OnEvent, Stage, Warning, WarningKind, timed};
use neat_images::resources::Resources;
use neat_images::scene::{examine_quickly, prepare_scene};
use neat_report::{PhotographConfig, Report};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::AssembleConfig;
use neat_wireframe::confidence::ConfidenceConfig;
use neat_wireframe::export::{WireframeDocument, write_json};
use neat_wireframe::metrics::ImageEvidence;
use serde_json::json;
use std::error::Error;
use std::path::Path;

/// Reads the scene in the folder `dir`, makes its wireframe with the default settings of
/// the command `neat`, and writes `wireframe.json` and `report.html` into `out`.
///
/// # Errors
/// If the scene cannot be read or would be lost time, or a result cannot be written.
pub fn reconstruct(dir: &Path, out: &Path) -> Result<(), Box<dyn Error>> {
    file::create_dir(out)?;
    let mut listener = Listener::default();
    let data = DataConfig::default();
    let detector = DetectorConfig::default();
    let (scene, distilled) = {
        let on_event: OnEvent<'_, ()> = &mut |event| listener.hear(&event);
        let scene = prepare(dir, &data, &detector, on_event)?;
        let distilled = timed(on_event, Stage::Distill, |on_event| {
            distill(&scene, &data, &detector, on_event)
        })?;
        if let Some(moved) = distilled.report.moved_poses() {
            on_event(Event::Decided(moved));
        }
        if distilled.wireframe.edges.is_empty() {
            let text = format!(
                "the wireframe has no edges: {}",
                distilled.report.why_empty(false)
            );
            on_event(Event::Warning(Warning::new(WarningKind::NoEdges, text)));
        }
        (scene, distilled)
    };
    let images = distilled.refined_scene.as_ref().unwrap_or(&scene);
    let agreement = agreement(images, data.min_segment_score, &distilled.wireframe);
    let document = document(&scene, &distilled, agreement);
    write_json(&out.join("wireframe.json"), &document)?;
    write_report(&scene, document, agreement, &data, listener, out)
}

/// The scene, if it is worth the time.
fn prepare(
    dir: &Path,
    data: &DataConfig,
    detector: &DetectorConfig,
    on_event: OnEvent<'_, ()>,
) -> Result<Scene, ImagesError> {
    let resources = Resources::default();
    let prepared = prepare_scene(dir, data, detector, None, resources, on_event)?;
    if !prepared.detected {
        // The page shows 2D wireframes of files like those that were detected.
        for view in &prepared.scene.views {
            on_event(Event::Detected(view));
        }
    }
    timed(on_event, Stage::Examine, |on_event| {
        examine_quickly(&prepared, data, resources.memory_limit, on_event)
    })?;
    Ok(prepared.scene)
}

/// Its wireframe, by the images alone.
fn distill(
    scene: &Scene,
    data: &DataConfig,
    detector: &DetectorConfig,
    on_event: OnEvent<'_, ()>,
) -> Result<Distilled, AssembleError> {
    let (radius, min_score) = (scene.sphere_radius, data.min_segment_score);
    let (assembler, assessing) = (AssembleConfig::default(), ConfidenceConfig::default());
    let views = ViewObservation::from_scene(scene, min_score);
    let progress = &mut |share| {
        on_event(Event::StageProgress {
            stage: Stage::Distill,
            fraction: 0.9 * share,
        });
        Ok(())
    };
    let draft = assemble_images(scene, &views, None, radius, detector, &assembler, progress)?;
    draft.assess(scene, min_score, None, radius, &assessing)
}

/// In the frame and unit of the files, as the command writes it, without what there is of
/// runs alone.
fn document(
    scene: &Scene,
    distilled: &Distilled,
    agreement: Option<ImageEvidence>,
) -> WireframeDocument {
    let mut metadata = distilled.metadata(agreement);
    let facts = [
        ("neat", json!(env!("CARGO_PKG_VERSION"))),
        ("scene", json!(scene.name)),
    ];
    metadata.extend(facts.map(|(key, value)| (key.to_owned(), value)));
    WireframeDocument {
        metadata,
        ..distilled.document(scene)
    }
}

/// `report.html`, with a photograph of every view that the report of a run would have.
fn write_report(
    scene: &Scene,
    document: WireframeDocument,
    agreement: Option<ImageEvidence>,
    data: &DataConfig,
    listener: Listener,
    out: &Path,
) -> Result<(), Box<dyn Error>> {
    let photographs = PhotographConfig::default();
    let mut report = Report::of_scene(scene, document, data.min_segment_score, &photographs)?;
    report.facts = listener.facts(result_facts(&report.document, agreement));
    report.warnings = listener.warnings;
    report.write(&out.join("report.html"))?;
    Ok(())
}
