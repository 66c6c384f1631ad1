//! Oriented points on the surfaces that posed images show.
#![forbid(unsafe_code)]

mod consistency;
mod depth_map;
mod gray_pyramid;
mod neighbours;
mod patch;
mod view;

use consistency::confirmed_points;
use depth_map::{DepthMap, REFINED_LEVELS};
use nalgebra::Vector3;
use neat_core::{Camera, Scene, SceneError};
use rayon::prelude::*;
use view::StereoView;

/// A point of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where it is.
    pub position_in_world: Vector3<f64>,
    /// Unit normal, towards the views.
    pub normal_in_world: Vector3<f64>,
    /// The view whose pixel it is.
    pub view: usize,
    /// Views that confirm it.
    pub confirmed_by: Vec<usize>,
    /// Standard deviation along the sight line.
    pub deviation: f64,
    /// Score.
    pub score: f32,
    /// Sharpness in pixels.
    pub sharpness: f32,
}

/// Neighbours that patches are compared with.
const MATCHED: usize = 4;
/// Neighbours that may confirm.
const CONFIRMING: usize = 8;
/// Least pixels along the longer side of the lattice.
const LATTICE: u32 = 128;

/// Points of all views.
///
/// # Errors
/// If an image cannot be read.
pub fn surface_points(scene: &Scene, ball_radius: f64) -> Result<Vec<SurfacePoint>, SceneError> {
    let start = std::time::Instant::now();
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let longer = |camera: &Camera| camera.width.max(camera.height);
    let largest = cameras.iter().map(longer).max().unwrap_or(0);
    let coarsest = (largest / LATTICE).max(1).ilog2() as usize;
    let views: Vec<StereoView> = (scene.views.par_iter())
        .map(|view| StereoView::new(view, scene.pixel_center, coarsest + 1))
        .collect::<Result<_, _>>()?;
    let _ = REFINED_LEVELS;
    let neighbours: Vec<Vec<usize>> = (0..views.len())
        .into_par_iter()
        .map(|view| neighbours::neighbours(&cameras, view, ball_radius, CONFIRMING))
        .collect();
    let maps: Vec<DepthMap> = (0..views.len())
        .into_par_iter()
        .map(|view| {
            let nearest = neighbours[view].iter().take(MATCHED);
            let others: Vec<&StereoView> = nearest.map(|&other| &views[other]).collect();
            DepthMap::estimate(&views[view], &others, ball_radius, view as u64)
        })
        .collect();
    tell(format_args!("maps {:.2} s", start.elapsed().as_secs_f64()));
    let points = (0..views.len())
        .into_par_iter()
        .map(|view| confirmed_points(&views, &maps, view, &neighbours[view], ball_radius))
        .collect::<Vec<_>>();
    tell(format_args!("all {:.2} s", start.elapsed().as_secs_f64()));
    Ok(points.into_iter().flatten().collect())
}

#[allow(clippy::print_stderr)]
fn tell(what: std::fmt::Arguments<'_>) {
    eprintln!("{what}");
}
