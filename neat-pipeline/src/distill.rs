//! From the images, or a trained field (paper §4.3), to the wireframe.

mod rendered_segments;
mod thin_regions;

pub use neat_images::assemble::{Cancelled, OnProgress};
pub use neat_images::distilled::{BackEndReport, Distilled, agreement};
pub use rendered_segments::support_point;
pub use thin_regions::paper_regions;

use crate::config::{BackEnd, Config, Partners};
use crate::plan::Plan;
use neat_core::{Scene, SceneError};
use neat_images::assemble::{AssembleError, Draft, assemble_images};
use neat_train::TrainedField;
use neat_wireframe::paper::{NeatLine, PaperBackEndError, neat_lines};
use neat_wireframe::validity::WireframeFlaw;
use neat_wireframe::{SignedDistance, ViewObservation};
use rayon::prelude::*;
use rendered_segments::rendered_segments;

/// Rays that tell the NEAT line of a 2D segment, in the mean, where partners are sought: of
/// some 200 that there are. F1 of a house is the same with all.
const RAYS_PER_LINE: usize = 64;

/// Why no wireframe could be taken out of a field.
#[derive(Debug, thiserror::Error)]
pub enum DistillError {
    /// Nobody wants it any more.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// An image lies in a file that cannot be read.
    #[error(transparent)]
    Image(#[from] SceneError),
    /// The paper's back end refused its input.
    #[error(transparent)]
    Paper(#[from] PaperBackEndError),
    /// A back end that asks the field, and none was trained.
    #[error("the {0} back end asks the field, and none was trained")]
    NoField(BackEnd),
    /// Partners are sought by the field, and none was trained.
    #[error("distill.partners = field asks the field, and none was trained")]
    NoFieldForPartners,
    /// The wireframe has a point that is no point.
    #[error("the wireframe is not valid")]
    Invalid(#[from] WireframeFlaw),
}

impl From<AssembleError> for DistillError {
    fn from(error: AssembleError) -> Self {
        match error {
            AssembleError::Cancelled(error) => Self::Cancelled(error),
            AssembleError::Image(error) => Self::Image(error),
            AssembleError::Invalid(flaw) => Self::Invalid(flaw),
        }
    }
}

/// Takes the wireframe out of the field, or, where the plan has the assembler, out of the
/// images: that needs no field.
///
/// # Errors
/// If there is no field and the back end asks it, the field's junctions or distances are not
/// finite, an image lies in a file that cannot be read, or `progress` says so.
pub fn distill(
    scene: &Scene,
    field: Option<&TrainedField>,
    plan: &Plan,
    progress: OnProgress<'_>,
) -> Result<Distilled, DistillError> {
    let config = plan.config();
    let back_end = plan.back_end();
    let min_score = match back_end {
        BackEnd::Paper => config.distill.paper.neat_lines.min_segment_score,
        BackEnd::Assembler => config.data.min_segment_score,
    };
    let views = ViewObservation::from_scene(scene, min_score);
    let scene_radius = config.data.scene_radius.unwrap_or(scene.sphere_radius);
    let (draft, surface) = match back_end {
        BackEnd::Paper => {
            let field = field.ok_or(DistillError::NoField(back_end))?;
            let draft = paper(scene, field, config, &views, progress)?;
            (draft, Some(field.surface_grid()))
        }
        // A learned surface is too coarse to hide edges behind.
        BackEnd::Assembler => {
            let asked = match config.distill.partners {
                Partners::Epipolar => None,
                Partners::Field => Some(field.ok_or(DistillError::NoFieldForPartners)?),
            };
            let draft = assembled(scene, asked, config, &views, scene_radius, progress)?;
            (draft, None)
        }
    };
    let hiding = surface.as_ref().map(|grid| grid as &dyn SignedDistance);
    let assessing = &config.distill.confidence;
    Ok(draft.assess(scene, min_score, hiding, scene_radius, assessing)?)
}

/// The assembler, which asks the images; and the field for partners, if that is given.
fn assembled(
    scene: &Scene,
    field: Option<&TrainedField>,
    config: &Config,
    views: &[ViewObservation],
    scene_radius: f64,
    progress: OnProgress<'_>,
) -> Result<Draft, DistillError> {
    let lines = match field {
        None => None,
        Some(field) => Some(field_lines(scene, field, config, views, &mut |share| {
            progress(0.3 * share)
        })?),
    };
    let begun = if lines.is_some() { 0.3 } else { 0.0 };
    let draft = assemble_images(
        scene,
        views,
        lines.as_deref(),
        scene_radius,
        &config.detect,
        &config.distill.assembler,
        &mut |share| progress(begun + (0.9 - begun) * share),
    )?;
    Ok(draft)
}

/// The NEAT lines of all views.
fn field_lines(
    scene: &Scene,
    field: &TrainedField,
    config: &Config,
    views: &[ViewObservation],
    progress: OnProgress<'_>,
) -> Result<Vec<Vec<NeatLine>>, Cancelled> {
    let rays = rendered_segments(scene, field, config, RAYS_PER_LINE, progress)?;
    let config = &config.distill.paper.neat_lines;
    let lines = views.par_iter().zip(&rays);
    Ok(lines
        .map(|(view, rays)| neat_lines(view, rays, config))
        .collect())
}

/// The paper's back end, which takes every ray of the thin regions.
fn paper(
    scene: &Scene,
    field: &TrainedField,
    config: &Config,
    views: &[ViewObservation],
    progress: OnProgress<'_>,
) -> Result<Draft, DistillError> {
    let rays = rendered_segments(scene, field, config, usize::MAX, &mut |share| {
        progress(0.95 * share)
    })?;
    let paper = &config.distill.paper;
    let built = paper.run(&field.junctions(), views, &rays, field)?;
    Ok(Draft {
        wireframe: built.wireframe,
        arcs: Vec::new(),
        arc_covariances: Vec::new(),
        splines: Vec::new(),
        domes: Vec::new(),
        report: BackEndReport::Paper {
            steps: built.counts,
        },
        min_structure: 0.0,
        refined_cameras: None,
    })
}
