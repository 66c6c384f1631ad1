//! The visual hull: where masks allow an object to be.

use crate::scene_sphere::{Ball, from_cameras, met_by_most};
use crate::{Camera, Ray};
use nalgebra::{Vector2, Vector3};

/// Where a view shows the object: a coarse grid of its image.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mask {
    /// Cells per row and per column.
    pub size: (usize, usize),
    /// Row by row; whether the cell shows something of the object.
    pub inside: Vec<bool>,
}

impl Mask {
    /// Whether the mask covers the projection of `point`; `None` where the camera
    /// does not see it.
    fn covers(&self, camera: &Camera, point: &Vector3<f64>) -> Option<bool> {
        let projection = camera.project(point);
        let cell = |x: f64, pixels: u32, cells: usize| {
            let share = x / f64::from(pixels);
            (0.0..1.0)
                .contains(&share)
                .then(|| ((share * cells as f64) as usize).min(cells - 1))
        };
        let column = cell(projection.pixel.x, camera.width, self.size.0)?;
        let row = cell(projection.pixel.y, camera.height, self.size.1)?;
        (projection.depth > 0.0).then(|| self.inside[row * self.size.0 + column])
    }

    /// The ray through the middle of the object, and the tangent of the angle around it that
    /// holds all of it. `None` where the mask does not show the whole object.
    fn silhouette(&self, camera: &Camera) -> Option<(Ray, f64)> {
        let (columns, rows) = self.size;
        let cells = || (0..columns * rows).filter(|&cell| self.inside[cell]);
        let is_cut = |cell: usize| {
            let (column, row) = (cell % columns, cell / columns);
            column == 0 || row == 0 || column + 1 == columns || row + 1 == rows
        };
        if cells().next().is_none() || cells().any(is_cut) {
            return None;
        }
        let pixel = |cell: usize| {
            let share = |at: usize, cells: usize| (at as f64 + 0.5) / cells as f64;
            Vector2::new(
                share(cell % columns, columns) * f64::from(camera.width),
                share(cell / columns, rows) * f64::from(camera.height),
            )
        };
        let middle = cells().map(pixel).sum::<Vector2<f64>>() / cells().count() as f64;
        let middle = camera.ray_through(&middle);
        let off = |cell| {
            let ray = camera.ray_through(&pixel(cell));
            middle.direction.angle(&ray.direction).tan()
        };
        Some((middle, cells().map(off).fold(0.0, f64::max)))
    }
}

/// Cells of the visual hull along each axis.
const HULL_CELLS: usize = 48;
/// A point belongs to the hull if so many of the views that see it show it within
/// their masks.
const HULL_SHARE: f64 = 0.95;
/// Networks and grids want some empty space around the object.
const HULL_MARGIN: f64 = 1.25;

/// Around the visual hull: what lies within the masks of all views that see it.
/// `None` where that is nothing. Behind an object that is seen from one side the hull is open: it
/// ends where the object would reach further than it is wide.
pub(crate) fn from_masks(cameras: &[Camera], masks: &[Mask]) -> Option<Ball> {
    let (center, radius) = from_cameras(cameras)?;
    let object = as_deep_as_wide(cameras, masks);
    // First coarsely in all that is seen, then finely in what is left.
    let (center, radius) = hull_ball(cameras, masks, object, (center, 1.5 * radius))?;
    let (center, radius) = hull_ball(cameras, masks, object, (center, 1.2 * radius))?;
    Some((center, HULL_MARGIN * radius))
}

/// The ball around where the views see the middle of the object that is as wide as the widest
/// of their silhouettes. `None` if half of them do not see the whole object.
fn as_deep_as_wide(cameras: &[Camera], masks: &[Mask]) -> Option<Ball> {
    let (middles, tangents): (Vec<Ray>, Vec<f64>) = (cameras.iter().zip(masks))
        .filter_map(|(camera, mask)| mask.silhouette(camera))
        .unzip();
    if 2 * middles.len() <= cameras.len() {
        return None;
    }
    let center = met_by_most(&middles)?;
    let radii = (middles.iter().zip(tangents))
        .map(|(middle, tangent)| tangent * (center - middle.origin).norm());
    Some((center, radii.fold(0.0, f64::max)))
}

/// A ball around the cells of the hull that lie within the ball `object`, in a cube given by its
/// centre and half its side.
fn hull_ball(
    cameras: &[Camera],
    masks: &[Mask],
    object: Option<Ball>,
    (center, half_side): (Vector3<f64>, f64),
) -> Option<Ball> {
    let cell = 2.0 * half_side / HULL_CELLS as f64;
    let at = |index: usize| (index as f64 + 0.5) * cell - half_side;
    let mut hull = Vec::new();
    for index in 0..HULL_CELLS.pow(3) {
        let [i, j, k] = [0, 1, 2].map(|axis| index / HULL_CELLS.pow(axis) % HULL_CELLS);
        let point = center + Vector3::new(at(i), at(j), at(k));
        if object.is_some_and(|(middle, radius)| (point - middle).norm() > radius) {
            continue;
        }
        let (mut seen, mut covered) = (0, 0);
        for (camera, mask) in cameras.iter().zip(masks) {
            if let Some(inside) = mask.covers(camera, &point) {
                seen += 1;
                covered += usize::from(inside);
            }
        }
        if 2 * seen >= cameras.len() && covered as f64 >= HULL_SHARE * seen as f64 {
            hull.push(point);
        }
    }
    let first = *hull.first()?;
    let low = hull.iter().fold(first, |low, point| low.inf(point));
    let high = hull.iter().fold(first, |high, point| high.sup(point));
    let middle = (low + high) / 2.0;
    let reach = hull
        .iter()
        .map(|point| (point - middle).norm())
        .fold(0.0, f64::max);
    // Half the diagonal of a cell: points stand for cells.
    Some((middle, reach + cell * 3f64.sqrt() / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene_sphere::tests::{camera, ring};
    use nalgebra::Rotation3;

    /// What the cameras see of a ball.
    fn masks_of_a_ball(cameras: &[Camera], center: Vector3<f64>, radius: f64) -> Vec<Mask> {
        let mask = |camera: &Camera| {
            let inside = (0..75 * 100).map(|index| {
                let pixel = [(index % 75) as f64, (index / 75) as f64].map(|x| 2.0 * x + 1.0);
                let ray = camera.ray_through(&pixel.into());
                (center - ray.origin).cross(&ray.direction).norm() < radius
            });
            Mask {
                size: (75, 100),
                inside: inside.collect(),
            }
        };
        cameras.iter().map(mask).collect()
    }

    #[test]
    fn the_hull_of_masks_holds_the_object() {
        let cameras = ring(Vector3::new(0.3, -0.2, 0.1), 10);
        let object = Vector3::new(0.6, 0.1, 0.0);
        let masks = masks_of_a_ball(&cameras, object, 0.7);
        let (center, radius) = from_masks(&cameras, &masks).unwrap();
        assert!((center - object).norm() < 0.2, "{center}");
        assert!((0.7..1.2).contains(&radius), "{radius}");

        let nothing = vec![
            Mask {
                size: (1, 1),
                inside: vec![false],
            };
            cameras.len()
        ];
        assert_eq!(from_masks(&cameras, &nothing), None);
    }

    #[test]
    fn an_object_seen_from_one_side_is_not_taken_for_deep() {
        let target = Vector3::new(0.3, -0.2, 0.1);
        let object = Vector3::new(0.4, -0.1, 0.0);
        // Within 18° of each other.
        let cameras: Vec<Camera> = (0..12)
            .map(|index| {
                let angles = [0.08 * f64::from(index % 4), 0.1 * f64::from(index / 4)];
                let turn = Rotation3::from_euler_angles(0.0, angles[0], angles[1]);
                camera(target + turn * Vector3::new(5.0, 0.0, 0.0), target)
            })
            .collect();
        let masks = masks_of_a_ball(&cameras, object, 0.7);
        let (center, radius) = from_masks(&cameras, &masks).unwrap();
        assert!((center - object).norm() < 0.2, "{center}");
        assert!((0.7..1.2).contains(&radius), "{radius}");

        // Where images cut the object off, how wide it is cannot be told.
        let whole = masks_of_a_ball(&cameras, object, 1e3);
        assert_eq!(as_deep_as_wide(&cameras, &whole), None);
    }
}
