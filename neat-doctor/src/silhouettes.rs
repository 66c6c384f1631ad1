//! Silhouettes: the evidence in images of smooth things before a plain background, whose
//! corners are few and move over the thing from view to view.
//!
//! With the right cameras the ray through any point of a silhouette comes by a place that all
//! other views show within theirs: the visual hull (Laurentini 1994). With wrong ones much of
//! the silhouettes is left over.

use crate::agreement::Tally;
use crate::gray_image::GrayImage;
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, Ray};
use rayon::prelude::*;

/// Cells along the larger side of an image: finer than any error that spoils a scene.
const CELLS: usize = 96;
/// A pixel whose brightness differs by more from the border's belongs to the thing: 5 of 255
/// levels, more than noise and compression do to a background.
const CONTRAST: f32 = 0.02;
/// Points of a silhouette that are looked for in the others.
const SAMPLES: usize = 64;
/// Places along each ray.
const PLACES: usize = 96;
/// The ball of the scene is larger than the thing; how large it is has been guessed.
const BALL: f64 = 1.5;
/// One of so many views may disagree about a place.
const ODD_VIEWS: usize = 20;
/// Cells beside a silhouette that the hull of the others may fill: it is as coarse as they are.
const MARGIN: usize = 3;

/// What the image of one view shows of the thing.
pub(crate) struct Silhouette {
    /// Index of the view.
    view: usize,
    columns: usize,
    rows: usize,
    /// Row by row, whether a cell or one beside it holds something of the thing.
    inside: Vec<bool>,
    /// Cells of the thing, as shares of width and height.
    samples: Vec<Vector2<f64>>,
    /// Cells well outside of it, as many of each area.
    around: Vec<Vector2<f64>>,
}

impl Silhouette {
    /// What stands before the background of an image with a border of one brightness: all
    /// that the border cannot be reached from without crossing it.
    pub fn new(view: usize, image: &GrayImage) -> Self {
        let cell = image.width.max(image.height).div_ceil(CELLS).max(1);
        let (columns, rows) = (image.width.div_ceil(cell), image.height.div_ceil(cell));
        let border = image.at(0, 0);
        let mut thing = vec![false; columns * rows];
        for y in 0..image.height {
            for x in 0..image.width {
                thing[y / cell * columns + x / cell] |= (image.at(x, y) - border).abs() > CONTRAST;
            }
        }
        let mut outside = vec![false; columns * rows];
        let on_border = |index: &usize| {
            let (column, row) = (index % columns, index / columns);
            column == 0 || row == 0 || column == columns - 1 || row == rows - 1
        };
        let mut open: Vec<usize> = (0..columns * rows).filter(on_border).collect();
        while let Some(index) = open.pop() {
            if outside[index] || thing[index] {
                continue;
            }
            outside[index] = true;
            open.extend(beside(index, columns, rows));
        }
        let filled: Vec<bool> = outside.iter().map(|outside| !outside).collect();
        let wider = |cells: &[bool]| -> Vec<bool> {
            (0..cells.len())
                .map(|index| cells[index] || beside(index, columns, rows).any(|at| cells[at]))
                .collect()
        };
        let inside = wider(&filled);
        let near = (1..MARGIN).fold(inside.clone(), |near, _| wider(&near));
        let step = (filled.iter().filter(|is| **is).count())
            .div_ceil(SAMPLES)
            .max(1);
        let sampled = |cells: &[bool], chosen: bool| {
            (0..cells.len())
                .filter(|index| cells[*index] == chosen)
                .step_by(step)
                .map(|index| {
                    let middle = Vector2::new((index % columns) as f64, (index / columns) as f64);
                    let middle = middle.add_scalar(0.5) * cell as f64;
                    middle.component_div(&Vector2::new(image.width as f64, image.height as f64))
                })
                .collect()
        };
        let (samples, around) = (sampled(&filled, true), sampled(&near, false));
        Self {
            view,
            columns,
            rows,
            inside,
            samples,
            around,
        }
    }

    /// Whether it covers an image point, given as shares of width and height.
    fn covers(&self, place: &Vector2<f64>) -> bool {
        let in_image = place.iter().all(|share| (0.0..1.0).contains(share));
        let column = (place.x * self.columns as f64) as usize;
        let row = (place.y * self.rows as f64) as usize;
        in_image && self.inside[row * self.columns + column]
    }
}

/// The cells beside one.
fn beside(index: usize, columns: usize, rows: usize) -> impl Iterator<Item = usize> {
    let (column, row) = (index % columns, index / columns);
    let left = (column > 0).then(|| index - 1);
    let right = (column + 1 < columns).then(|| index + 1);
    let above = (row > 0).then(|| index - columns);
    let below = (row + 1 < rows).then(|| index + columns);
    [left, right, above, below].into_iter().flatten()
}

/// The share of all silhouettes that has a place in the hull of the others, within a ball
/// around the origin. `cameras` are those of all views of the scene.
pub(crate) fn covered_share(silhouettes: &[Silhouette], cameras: &[Camera], radius: f64) -> f64 {
    let of_one = |own: &Silhouette| covered_of(&own.samples, own, silhouettes, cameras, radius);
    let counts: Vec<Tally> = silhouettes.par_iter().map(of_one).collect();
    let mut all = Tally::default();
    counts.into_iter().for_each(|of_one| all += of_one);
    all.share()
}

/// How well the silhouette of one view is that of the hull of the others: what both cover as a
/// share of what either does. `None` if the view has none.
pub(crate) fn fit_of(
    view: usize,
    silhouettes: &[Silhouette],
    cameras: &[Camera],
    radius: f64,
) -> Option<f64> {
    let own = silhouettes.iter().find(|own| own.view == view)?;
    let covered = |samples| covered_of(samples, own, silhouettes, cameras, radius);
    let (both, beyond) = (covered(&own.samples), covered(&own.around));
    Some(both.explained as f64 / (both.total + beyond.explained).max(1) as f64)
}

/// Of how many samples of the view of one silhouette, how many have a place in the hull of the
/// others.
fn covered_of(
    samples: &[Vector2<f64>],
    own: &Silhouette,
    silhouettes: &[Silhouette],
    cameras: &[Camera],
    radius: f64,
) -> Tally {
    let camera = &cameras[own.view];
    let size = Vector2::new(f64::from(camera.width), f64::from(camera.height));
    let covered = |sample: &&Vector2<f64>| {
        let ray = camera.ray_through(&sample.component_mul(&size));
        places(&ray, BALL * radius)
            .map(|along| ray.origin + along * ray.direction)
            .any(|point| is_in_hull(silhouettes, cameras, own.view, &point))
    };
    Tally {
        explained: samples.iter().filter(covered).count(),
        total: samples.len(),
    }
}

/// Depths of places along a ray within a ball around the origin.
fn places(ray: &Ray, radius: f64) -> impl Iterator<Item = f64> {
    let middle = -ray.origin.dot(&ray.direction);
    let off = (ray.origin + middle * ray.direction).norm_squared();
    // NaN, which is no place, where the ray misses the ball.
    let half = (radius * radius - off).sqrt();
    (0..PLACES)
        .map(move |place| middle + half * (2.0 * (place as f64 + 0.5) / PLACES as f64 - 1.0))
        .filter(|depth| *depth > 0.0)
}

/// Whether a silhouette covers a point of space.
fn shows(silhouette: &Silhouette, cameras: &[Camera], point: &Vector3<f64>) -> bool {
    let camera = &cameras[silhouette.view];
    let projection = camera.project(point);
    let size = Vector2::new(f64::from(camera.width), f64::from(camera.height));
    projection.depth > 0.0 && silhouette.covers(&projection.pixel.component_div(&size))
}

fn is_in_hull(
    silhouettes: &[Silhouette],
    cameras: &[Camera],
    own: usize,
    point: &Vector3<f64>,
) -> bool {
    let mut odd = silhouettes.len() / ODD_VIEWS;
    silhouettes.iter().filter(|s| s.view != own).all(|other| {
        if shows(other, cameras, point) {
            return true;
        }
        let may_be_odd = odd > 0;
        odd = odd.saturating_sub(1);
        may_be_odd
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3};
    use neat_core::Intrinsics;

    const SIZE: u32 = 120;

    /// Cameras around the origin at several heights.
    fn cameras() -> Vec<Camera> {
        (0..12)
            .map(|index| {
                let angle = f64::from(index);
                let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
                let position = turn * Vector3::new(4.0, 0.0, 3.0 * angle.sin());
                let forward = -position.normalize();
                let right = forward.cross(&Vector3::z()).normalize();
                let rotation = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
                let intrinsics = Intrinsics {
                    fx: 150.0,
                    fy: 150.0,
                    cx: 60.0,
                    cy: 60.0,
                    skew: 0.0,
                };
                let mut pose = rotation.to_homogeneous();
                pose.fixed_view_mut::<3, 1>(0, 3).copy_from(&position);
                Camera::from_matrices(intrinsics, &pose, SIZE, SIZE)
            })
            .collect()
    }

    /// Two balls of different sizes, the larger with a dark spot, before black.
    fn balls(camera: &Camera) -> GrayImage {
        let balls = [
            (Vector3::new(0.5, 0.1, 0.0), 0.3),
            (Vector3::new(-0.4, 0.0, 0.2), 0.5),
        ];
        let value = |index: u32| {
            let pixel = [index % SIZE, index / SIZE].map(|x| f64::from(x) + 0.5);
            let ray = camera.ray_through(&pixel.into());
            let off = |center: &Vector3<f64>| (center - ray.origin).cross(&ray.direction).norm();
            let hit = balls.iter().any(|(center, radius)| off(center) < *radius);
            let dark = off(&balls[1].0) < 0.2;
            if hit && !dark { 0.5 } else { 0.0 }
        };
        GrayImage {
            width: SIZE as usize,
            height: SIZE as usize,
            values: (0..SIZE * SIZE).map(value).collect(),
        }
    }

    #[test]
    fn right_cameras_explain_silhouettes_and_wrong_ones_do_not() {
        let mut cameras = cameras();
        let silhouettes: Vec<Silhouette> = (cameras.iter().enumerate())
            .map(|(view, camera)| Silhouette::new(view, &balls(camera)))
            .collect();
        // A ball larger than the scene, and one that is too small.
        let right = covered_share(&silhouettes, &cameras, 1.0);
        assert!(right > 0.98, "{right}");
        assert!(covered_share(&silhouettes, &cameras, 0.1) < 0.8);
        let of_view = |cameras: &[Camera]| fit_of(3, &silhouettes, cameras, 1.0);
        assert!(of_view(&cameras).is_some_and(|share| share > 0.98));
        // The camera of another view.
        let mut exchanged = cameras.clone();
        exchanged[3] = cameras[8];
        assert!(of_view(&exchanged).is_some_and(|share| share < 0.9));
        // One that shows more than it did.
        let mut wide = cameras.clone();
        wide[3].intrinsics.fx *= 1.4;
        wide[3].intrinsics.fy *= 1.4;
        assert!(of_view(&wide).is_some_and(|share| share < 0.7));
        assert!(fit_of(99, &silhouettes, &cameras, 1.0).is_none());
        cameras.rotate_left(5);
        let wrong = covered_share(&silhouettes, &cameras, 1.0);
        assert!(wrong < 0.85, "{wrong}");
    }

    #[test]
    fn what_the_background_does_not_reach_is_inside() {
        let camera = &cameras()[0];
        let silhouette = Silhouette::new(0, &balls(camera));
        let at = |point: Vector3<f64>| {
            let pixel = camera.project(&point).pixel;
            silhouette.covers(&(pixel / f64::from(SIZE)))
        };
        // The middle of the dark spot, and beside both balls.
        assert!(at(Vector3::new(-0.4, 0.0, 0.2)));
        assert!(!at(Vector3::new(0.0, 0.9, 0.9)));
    }
}
