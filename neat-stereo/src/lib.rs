//! Points with normals on the surfaces that posed photographs show, by multi-view
//! photo-consistency: classical stereo without learning and without a field.
//!
//! Each view is matched with its neighbours: a plane sweep (Collins 1996) on small images,
//! then slanted patches that neighbouring pixels propose to each other on ever larger ones
//! (Bleyer, Rhemann and Rother 2011), compared by normalised cross-correlation over those
//! neighbours that agree best (Goesele et al. 2007). What two further views confirm is a
//! point (Schönberger et al. 2016). Where nothing is photo-consistent there are no points.
//!
//! The points do not depend on the number of threads.
//!
//! ```no_run
//! use neat_core::{LoadOptions, load_scene};
//! use neat_stereo::match_views;
//! use std::ops::ControlFlow;
//!
//! let scene = load_scene("SCENE", &LoadOptions::default())?.scene;
//! let points = match_views(&scene, scene.sphere_radius, &mut |share| {
//!     println!("{:.0} %", 100.0 * share);
//!     ControlFlow::Continue(())
//! })?;
//! println!("{} points", points.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

mod consistency;
mod depth_map;
mod gray_pyramid;
mod matcher;
mod neighbours;
mod patch;
mod view;

use consistency::Maps;
use depth_map::DepthMap;
use matcher::MAX_OTHERS;
use nalgebra::Vector3;
use neat_core::{Scene, SceneError, View};
use neighbours::neighbours;
use rayon::prelude::*;
use std::ops::ControlFlow;
use thiserror::Error;
use view::StereoView;

/// Views that may confirm a point of another one.
const CONFIRMING: usize = 8;
/// The lattice of pixels, and the images that are swept, have at least so many on their
/// longer side: enough for the planes of a building, which the finer levels put right.
const LATTICE: u32 = 128;
/// Finer levels that are matched after a sweep: up to 1024 to 2048 pixels.
const FINER_LEVELS: usize = 3;

/// A point on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where it is.
    pub position_in_world: Vector3<f64>,
    /// Of length 1, to the side of the views.
    pub normal_in_world: Vector3<f64>,
    /// Standard deviation of the surfaces that the views see, along the sight line of one,
    /// in the world.
    pub deviation: f64,
    /// The views that agree on it, at least three, ascending.
    pub views: Vec<usize>,
}

/// Why there are no points.
#[derive(Debug, Error)]
pub enum StereoError {
    /// An image cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Nobody wants them any more.
    #[error("matching the views was interrupted")]
    Interrupted,
}

/// Receives the share that is done, from 0 to 1, ascending, and says whether to go on.
pub type OnProgress<'a> = &'a mut dyn FnMut(f64) -> ControlFlow<()>;

/// Points on what the views of `scene` show within the ball of radius `ball_radius` around
/// the origin of its world, in the order of the views and their pixels. There are none where
/// fewer than three views show the same, or nothing has texture.
///
/// Of each image two bytes a pixel are kept, up to 2048 pixels wide.
///
/// # Errors
/// If an image cannot be read, or `progress` says so.
pub fn match_views(
    scene: &Scene,
    ball_radius: f64,
    progress: OnProgress<'_>,
) -> Result<Vec<SurfacePoint>, StereoError> {
    let longer_side = |view: &View| view.camera.width.max(view.camera.height);
    let largest = scene.views.iter().map(longer_side).max().unwrap_or(0);
    let coarsest = (largest / LATTICE).max(1).ilog2() as usize;
    let levels = coarsest.saturating_sub(FINER_LEVELS)..=coarsest;
    let views: Vec<StereoView> = (scene.views.par_iter())
        .map(|view| StereoView::new(view, scene.pixel_center, levels.clone()))
        .collect::<Result<_, _>>()?;
    let neighbours: Vec<Vec<usize>> = (0..views.len())
        .into_par_iter()
        .map(|view| neighbours(&views, view, ball_radius, CONFIRMING))
        .collect();
    let estimate = |view: usize| {
        let others = neighbours[view].iter().take(MAX_OTHERS);
        let others: Vec<&StereoView> = others.map(|&other| &views[other]).collect();
        DepthMap::estimate(&views[view], &others, ball_radius, view as u64)
    };
    let maps = with_progress(views.len(), estimate, progress)?;
    let maps = Maps {
        views: &views,
        maps: &maps,
    };
    let confirmed = (0..views.len())
        .into_par_iter()
        .map(|view| maps.confirmed(view, &neighbours[view], ball_radius));
    Ok(confirmed
        .collect::<Vec<_>>()
        .into_iter()
        .flatten()
        .collect())
}

/// `work` on all of `count` views, as many at a time as there are threads.
fn with_progress<T: Send>(
    count: usize,
    work: impl Fn(usize) -> T + Sync,
    progress: OnProgress<'_>,
) -> Result<Vec<T>, StereoError> {
    let mut done = Vec::with_capacity(count);
    while done.len() < count {
        if progress(done.len() as f64 / count as f64).is_break() {
            return Err(StereoError::Interrupted);
        }
        let end = count.min(done.len() + rayon::current_num_threads());
        let next: Vec<T> = (done.len()..end).into_par_iter().map(&work).collect();
        done.extend(next);
    }
    Ok(done)
}
