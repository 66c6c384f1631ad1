//! From the images of a scene to its wireframe: edgels, and the assembler.

use crate::distilled::BackEndReport;
use nalgebra::Matrix4;
use neat_core::{Camera, CircularArc, Dome, EdgelMap, Scene, SceneError, Spline, Wireframe3d};
use neat_detect::{DetectorConfig, edgel_maps};
use neat_wireframe::ViewObservation;
use neat_wireframe::assemble::{
    AssembleConfig, Assembled, Photographs, Witnesses, assemble_with_progress,
};
use neat_wireframe::paper::NeatLine;
use neat_wireframe::validity::WireframeFlaw;
use std::cell::OnceCell;
use std::ops::ControlFlow;

/// Who listens to the progress wants the distillation to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Cancelled;

/// Receives the share that is done, from 0 to 1, and says whether to go on.
pub type OnProgress<'a> = &'a mut dyn FnMut(f64) -> Result<(), Cancelled>;

/// Why no wireframe could be made of images.
#[derive(Debug, thiserror::Error)]
pub enum AssembleError {
    /// Nobody wants it any more.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// An image lies in a file that cannot be read.
    #[error(transparent)]
    Image(#[from] SceneError),
    /// The wireframe has a point that is no point.
    #[error("the wireframe is not valid")]
    Invalid(#[from] WireframeFlaw),
}

/// What a back end has made, before it is asked how sure that is.
#[derive(Clone, Debug)]
pub struct Draft {
    /// In the world frame of the scene's cameras.
    pub wireframe: Wireframe3d,
    /// Arcs of circles beside its edges, likewise.
    pub arcs: Vec<CircularArc>,
    /// How sure their centres and radii are, see [`Assembled::arc_covariances`].
    pub arc_covariances: Vec<Option<Matrix4<f64>>>,
    /// Smooth curves that are no circles, likewise.
    pub splines: Vec<Spline>,
    /// Parts of spheres that outlines show, likewise.
    pub domes: Vec<Dome>,
    /// What each step kept and removed.
    pub report: BackEndReport,
    /// Edges that are structure with less than this probability are left out.
    pub min_structure: f64,
    /// The cameras where the images show the wireframe, if they were moved.
    pub refined_cameras: Option<Vec<Camera>>,
}

/// The assembler, which asks the images. `lines` are NEAT lines of the 2D segments of
/// each view: they take the place of epipolar matches. `views` is of the same scene.
///
/// # Errors
/// If an image lies in a file that cannot be read, or `progress` says so.
pub fn assemble_images(
    scene: &Scene,
    views: &[ViewObservation],
    lines: Option<&[Vec<NeatLine>]>,
    scene_radius: f64,
    detector: &DetectorConfig,
    config: &AssembleConfig,
    progress: OnProgress<'_>,
) -> Result<Draft, AssembleError> {
    let edgels = edgels(scene, detector, &mut |share| progress(share / 3.0))?;
    let on_progress = &mut |share| match progress((1.0 + 2.0 * share) / 3.0) {
        Ok(()) => ControlFlow::Continue(()),
        Err(Cancelled) => ControlFlow::Break(()),
    };
    let unreadable = OnceCell::new();
    let image_of = |view: usize| {
        let image = scene.views[view].image.read();
        image.map_err(|error| unreadable.set(error)).ok()
    };
    let witnesses = Witnesses {
        views,
        edgels: &edgels,
        photographs: Some(Photographs {
            image_of: &image_of,
            pixel_center: scene.pixel_center,
        }),
        field_lines: lines,
    };
    let built = assemble_with_progress(&witnesses, scene_radius, config, on_progress);
    if let Some(error) = unreadable.into_inner() {
        return Err(error.into());
    }
    match built {
        ControlFlow::Continue(built) => Ok(Draft::new(built, config.min_structure)),
        ControlFlow::Break(()) => Err(Cancelled.into()),
    }
}

impl Draft {
    fn new(built: Assembled, min_structure: f64) -> Self {
        Self {
            wireframe: built.wireframe,
            arcs: built.arcs,
            arc_covariances: built.arc_covariances,
            splines: built.splines,
            domes: built.domes,
            report: BackEndReport::Assembler {
                steps: built.report,
            },
            min_structure,
            refined_cameras: built.refined_cameras,
        }
    }
}

/// The edgels of all images.
fn edgels(
    scene: &Scene,
    config: &DetectorConfig,
    progress: OnProgress<'_>,
) -> Result<Vec<EdgelMap>, AssembleError> {
    let views = &scene.views;
    let mut maps = Vec::with_capacity(views.len());
    // Some at a time, so that progress can be told in between.
    for chunk in views.chunks(4 * rayon::current_num_threads()) {
        maps.extend(edgel_maps(chunk, config, scene.pixel_center)?);
        progress(maps.len() as f64 / views.len() as f64)?;
    }
    Ok(maps)
}
