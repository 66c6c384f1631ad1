//! From the images, or a trained field (paper §4.3), to the wireframe.

mod rendered_segments;
mod thin_regions;

use crate::config::{BackEnd, Config, Partners};
use crate::event::{Decision, POSES};
use crate::plan::Plan;
use nalgebra::Matrix4;
use neat_core::{CircularArc, EdgelMap, Scene, SceneError, Wireframe3d};
use neat_detect::{DetectorConfig, edgel_maps};
use neat_train::TrainedField;
use neat_wireframe::assemble::{AssembleReport, Assembled, assemble_with_progress};
use neat_wireframe::confidence::{Confidence, assess, fill_arcs};
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::faces::{MeasuredGraph, Shell, find_shells};
use neat_wireframe::kinds::{EdgeKinds, curved_chains, edge_kinds, fill_kinds, junction_types};
use neat_wireframe::metrics::{ImageEvidence, ImageEvidenceConfig, image_evidence};
use neat_wireframe::paper::{NeatLine, PaperBackEndCounts, PaperBackEndError, neat_lines};
use neat_wireframe::validity::WireframeFlaw;
use neat_wireframe::{SignedDistance, ViewObservation};
use rayon::prelude::*;
use rendered_segments::rendered_segments;
pub use rendered_segments::support_point;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
pub use thin_regions::paper_regions;

/// Rays that tell the NEAT line of a 2D segment, in the mean, where partners are sought: of
/// some 200 that there are. F1 of a house is the same with all.
const RAYS_PER_LINE: usize = 64;

/// Who listens to the progress wants the distillation to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Cancelled;

/// Receives the share that is done, from 0 to 1, and says whether to go on.
pub type OnProgress<'a> = &'a mut dyn FnMut(f64) -> Result<(), Cancelled>;

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

/// A wireframe and how it came about.
#[derive(Clone, Debug)]
pub struct Distilled {
    /// In the world frame of the scene's cameras.
    pub wireframe: Wireframe3d,
    /// Arcs of circles beside its edges, likewise.
    pub arcs: Vec<CircularArc>,
    /// Faces between edges and arcs, likewise.
    pub shells: Vec<Shell>,
    /// How sure their centres and radii are, see [`Assembled::arc_covariances`].
    pub arc_covariances: Vec<Option<Matrix4<f64>>>,
    /// How sure every junction and edge is, and by which 2D segments.
    pub confidence: Confidence,
    /// What each edge is: of the shape of things, or on it.
    pub kinds: Vec<EdgeKinds>,
    /// What each step kept and removed.
    pub report: BackEndReport,
    /// The scene with its poses where the images show the wireframe, if they were moved.
    pub refined_scene: Option<Scene>,
}

/// What each step of a back end kept and removed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "back_end", rename_all = "snake_case")]
pub enum BackEndReport {
    /// Of the paper's.
    Paper {
        /// How many things entered and left its steps.
        steps: PaperBackEndCounts,
    },
    /// Of the assembler.
    Assembler {
        /// What its steps found.
        steps: AssembleReport,
    },
}

impl BackEndReport {
    /// How far the poses were moved, if they were.
    pub fn moved_poses(&self) -> Option<Decision> {
        let Self::Assembler { steps } = self else {
            return None;
        };
        (steps.poses_moved_in_pixels > 0.0).then(|| Decision {
            setting: POSES.to_owned(),
            value: format!("moved by {:.2} pixels", steps.poses_moved_in_pixels),
            reason: format!(
                "as {:.0} % of what lines in space ask for is found by each half of them",
                100.0 * steps.pose_reliability
            ),
        })
    }

    /// Why there is no edge, by what the steps found with these `partners`.
    pub fn why_empty(&self, partners: Partners) -> String {
        let found = match self {
            Self::Paper { .. } => {
                return "the field shows none: train longer, or give --preset balanced".to_owned();
            }
            Self::Assembler { steps } => steps,
        };
        let segments = format!(
            "of {} 2D segments in {} views",
            found.usable_segments, found.usable_views
        );
        const LOOK: &str = "look at `neat doctor SCENE` and at the pictures in overlays/";
        if found.usable_segments == 0 {
            format!(
                "there is no 2D segment in {} views: {LOOK}",
                found.usable_views
            )
        } else if found.segments_with_hypotheses == 0 && partners == Partners::Field {
            format!("{segments} the field puts none near one of another view: train longer")
        } else if found.segments_with_hypotheses == 0 {
            format!(
                "{segments} none has a partner in another view within the scene sphere: the \
                 sphere, the poses or the 2D wireframes are wrong; {LOOK}"
            )
        } else if found.lines + found.curved_lines + found.outlines == 0 {
            format!(
                "{segments} {} have positions in space, none of which enough images show: the \
                 poses, or 2D wireframes of other images; {LOOK}",
                found.segments_with_hypotheses
            )
        } else {
            format!(
                "the {} lines that the images show bend, or are outlines of round things",
                found.curved_lines + found.outlines
            )
        }
    }
}

impl Distilled {
    /// The wireframe in the frame of the user's files, with what is known about its
    /// parts; `scene` is the one that it is of.
    pub fn document(&self, scene: &Scene) -> WireframeDocument {
        let original_from_world = &scene.original_from_world;
        let original = (self.wireframe).map(|point| original_from_world.apply(point));
        let mut document = WireframeDocument::from(&original);
        let names: Vec<String> = scene.views.iter().map(|view| view.name.clone()).collect();
        document.shells = (self.shells.iter())
            .map(|shell| shell.map(|point| original_from_world.apply(point)))
            .collect();
        fill_arcs(
            &mut document,
            &self.arcs,
            &self.arc_covariances,
            original_from_world,
        );
        self.confidence
            .fill(&mut document, &names, original_from_world);
        fill_kinds(&mut document, &self.kinds, &junction_types(&self.wireframe));
        let curved = curved_chains(&self.wireframe);
        if curved.contains(&true) {
            document.edge_fields.curved = Some(curved);
        }
        document
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
    let min_score = match plan.back_end() {
        BackEnd::Paper => config.distill.paper.neat_lines.min_segment_score,
        BackEnd::Assembler => config.data.min_segment_score,
    };
    let views = ViewObservation::from_scene(scene, min_score);
    let scene_radius = config.data.scene_radius.unwrap_or(scene.sphere_radius);
    let back_end = plan.back_end();
    let mut refined_scene = None;
    let (mut arcs, mut arc_covariances) = (Vec::new(), Vec::new());
    let (wireframe, report, surface) = match back_end {
        BackEnd::Paper => {
            let field = field.ok_or(DistillError::NoField(back_end))?;
            let (wireframe, report) = paper(scene, field, config, &views, progress)?;
            (wireframe, report, Some(field.surface_grid()))
        }
        // A learned surface is too coarse to hide edges behind.
        BackEnd::Assembler => {
            let asked = match config.distill.partners {
                Partners::Epipolar => None,
                Partners::Field => Some(field.ok_or(DistillError::NoFieldForPartners)?),
            };
            let built = assembled(scene, asked, config, &views, scene_radius, progress)?;
            let steps = built.report;
            (arcs, arc_covariances) = (built.arcs, built.arc_covariances);
            refined_scene =
                (built.refined_cameras).map(|cameras| scene.clone().with_cameras(&cameras));
            (built.wireframe, BackEndReport::Assembler { steps }, None)
        }
    };
    // The rest asks the images from where they show the wireframe.
    let scene = refined_scene.as_ref().unwrap_or(scene);
    let views = ViewObservation::from_scene(scene, min_score);
    let hiding = surface.as_ref().map(|grid| grid as &dyn SignedDistance);
    let assessing = &config.distill.confidence;
    let confidence = assess(&wireframe, &views, hiding, scene_radius, assessing)?;
    let edges = confidence.edges.iter();
    let shown: Vec<Vec<usize>> = edges.map(|edge| edge.showing_views.clone()).collect();
    let kinds = edge_kinds(&wireframe, scene, &shown)?;
    let junctions = confidence.junctions.iter();
    let covariances: Vec<_> = junctions.map(|junction| junction.covariance).collect();
    let graph = MeasuredGraph {
        wireframe: &wireframe,
        arcs: &arcs,
        covariances: &covariances,
    };
    let shells = find_shells(&graph, &views);
    Ok(Distilled {
        wireframe,
        arcs,
        shells,
        arc_covariances,
        confidence,
        kinds,
        report,
        refined_scene,
    })
}

/// The assembler, which asks the images; and the field for partners, if that is given.
fn assembled(
    scene: &Scene,
    field: Option<&TrainedField>,
    config: &Config,
    views: &[ViewObservation],
    scene_radius: f64,
    progress: OnProgress<'_>,
) -> Result<Assembled, DistillError> {
    let lines = match field {
        None => None,
        Some(field) => Some(field_lines(scene, field, config, views, &mut |share| {
            progress(0.3 * share)
        })?),
    };
    let begun = if lines.is_some() { 0.3 } else { 0.0 };
    let rest = 0.9 - begun;
    let edgels = edgels(scene, &config.detect, &mut |share| {
        progress(begun + rest / 3.0 * share)
    })?;
    let on_progress = &mut |share| match progress(begun + rest * (1.0 + 2.0 * share) / 3.0) {
        Ok(()) => ControlFlow::Continue(()),
        Err(Cancelled) => ControlFlow::Break(()),
    };
    let config = &config.distill.assembler;
    let lines = lines.as_deref();
    let built = assemble_with_progress(views, &edgels, lines, scene_radius, config, on_progress);
    match built {
        ControlFlow::Continue(built) => Ok(built),
        ControlFlow::Break(()) => Err(Cancelled.into()),
    }
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

/// The edgels of all images.
fn edgels(
    scene: &Scene,
    config: &DetectorConfig,
    progress: OnProgress<'_>,
) -> Result<Vec<EdgelMap>, DistillError> {
    let views = &scene.views;
    let mut maps = Vec::with_capacity(views.len());
    // Some at a time, so that progress can be told in between.
    for chunk in views.chunks(4 * rayon::current_num_threads()) {
        maps.extend(edgel_maps(chunk, config, scene.pixel_center)?);
        progress(maps.len() as f64 / views.len() as f64)?;
    }
    Ok(maps)
}

/// How well a wireframe in the scene's world agrees with the 2D segments and the
/// sparse points, with lengths in the unit of the user's files; `None` for a
/// wireframe that is not valid.
pub fn agreement(scene: &Scene, config: &Config, wireframe: &Wireframe3d) -> Option<ImageEvidence> {
    let views = ViewObservation::from_scene(scene, config.data.min_segment_score);
    let points: Vec<_> = (scene.sparse_points.iter())
        .map(|point| point.position_in_world)
        .collect();
    let config = ImageEvidenceConfig::default();
    let mut evidence = image_evidence(wireframe, &views, &points, &config).ok()?;
    if let Some(distance) = &mut evidence.median_junction_to_point_distance {
        *distance *= scene.original_from_world.length_factor();
    }
    Some(evidence)
}

/// The paper's back end, which takes every ray of the thin regions.
fn paper(
    scene: &Scene,
    field: &TrainedField,
    config: &Config,
    views: &[ViewObservation],
    progress: OnProgress<'_>,
) -> Result<(Wireframe3d, BackEndReport), DistillError> {
    let rays = rendered_segments(scene, field, config, usize::MAX, &mut |share| {
        progress(0.95 * share)
    })?;
    let paper = &config.distill.paper;
    let built = paper.run(&field.junctions(), views, &rays, field)?;
    let report = BackEndReport::Paper {
        steps: built.counts,
    };
    Ok((built.wireframe, report))
}
