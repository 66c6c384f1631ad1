//! Line3D++ on the 2D wireframes of a scene: 3D segments by matching 2D segments over
//! neighbouring views, without training.

use crate::error::LabError;
use neat_core::file;
use neat_pipeline::config::Config;
use neat_pipeline::distill::agreement;
use neat_pipeline::event::OnEvent;
use neat_pipeline::resources::Resources;
use neat_pipeline::scene::prepare_scene;
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{Line3dConfig, line3d, wireframe_of_segments};
use neat_wireframe::export::{WireframeDocument, write_json, write_obj, write_ply};
use neat_wireframe::metrics::ImageEvidence;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What came out.
#[derive(Clone, Debug)]
pub struct Line3dResult {
    /// Number of segments.
    pub segments: usize,
    /// Seconds of the matching.
    pub seconds: f64,
    /// How well they agree with the images.
    pub agreement: Option<ImageEvidence>,
    /// `wireframe.json`.
    pub file: PathBuf,
}

/// Reconstructs `scene` and writes `wireframe.json`, `.obj` and `.ply` into `out`, in the
/// frame of the scene's files. Segments share no junctions.
///
/// # Errors
/// If the scene cannot be read, or a result cannot be written.
pub fn reconstruct_line3d(
    scene: &Path,
    out: &Path,
    config: &Config,
    line3d_config: &Line3dConfig,
    resources: Resources<'_>,
    on_event: OnEvent<'_>,
) -> Result<Line3dResult, LabError> {
    let scene = prepare_scene(scene, config, None, resources, on_event)?.scene;
    let observations = ViewObservation::from_scene(&scene, config.data.min_segment_score);
    let start = Instant::now();
    let segments = line3d(&observations, scene.sphere_radius, line3d_config);
    let seconds = start.elapsed().as_secs_f64();

    let in_world = wireframe_of_segments(&segments);
    let wireframe = in_world.map(|point| scene.original_from_world.apply(point));
    let mut document = WireframeDocument::from(&wireframe);
    document.metadata.insert("method".into(), "line3d".into());
    document
        .metadata
        .insert("scene".into(), scene.name.clone().into());
    document.views = scene.views.iter().map(|view| view.name.clone()).collect();
    let views = segments.iter().map(|segment| segment.views);
    document.edge_fields.supporting_views = Some(views.collect());
    file::create_dir(out)?;
    let path = |extension: &str| out.join("wireframe").with_extension(extension);
    write_json(&path("json"), &document)?;
    write_obj(&path("obj"), &wireframe, &[])?;
    write_ply(&path("ply"), &wireframe, &[])?;
    Ok(Line3dResult {
        segments: segments.len(),
        seconds,
        agreement: agreement(&scene, config.data.min_segment_score, &in_world),
        file: path("json"),
    })
}
