//! Spheres around the points of an axis of which edgels may be outlines.
//!
//! The camera and an edgel of an outline span a plane that touches the surface. The normals of a
//! surface of revolution meet its axis, so one such edgel tells where it is touched, and of a sphere
//! around a point of the axis the centre and the radius. They vote for these by the size of a rim.

use crate::solve::{Cauchy, reweighted};
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, CircularArc, Edgel};

/// A circle around an axis.
pub(super) struct Rim {
    pub height: f64,
    pub radius: f64,
}

/// Where an axis runs.
pub(super) struct AxisLine {
    pub origin: Vector3<f64>,
    /// Of length 1.
    pub direction: Vector3<f64>,
}

/// A sphere around a point of an axis, of which an edgel is the outline.
#[derive(Clone, Copy)]
pub(super) struct TouchedSphere {
    /// Of its centre.
    pub height: f64,
    pub radius: f64,
    /// The cosine of the angle between the axis and the normal where it is touched.
    pub along: f64,
}

/// Spheres are sought by so many cells to the radius of a rim: edgels are off by one or two degrees.
const CELLS: f64 = 24.0;
/// Radii and distances from a rim that are sought, by its radius: flatter than a sphere of four radii
/// a dome is an eighth of its rim's radius high.
const FARTHEST: f64 = 4.0;
/// Of a sphere as high as it is wide, edgels that tell of a cylinder or of nearly the pole itself say
/// nothing about the centre: the cosines of their normals to the axis.
const COSINES: [f64; 2] = [0.1, 0.995];
/// Fewer edgels in a cell are none.
const MIN_VOTES: u32 = 30;
/// So many spheres are tried for each rim.
const MOST: usize = 6;

/// Spheres are about the same within so many cells …
const BESIDE_IN_CELLS: f64 = 3.0;
/// … and agree after so many rounds.
const AGREEING_ROUNDS: usize = 4;
/// What keeps a parameter where no edgel tells of it.
const RIDGE: f64 = 1e-6;

impl AxisLine {
    /// How far it is from being the axis of an arc: at its centre, or along it.
    pub(super) fn distance_to(&self, arc: &CircularArc) -> f64 {
        let off = (arc.center - self.origin).cross(&self.direction).norm();
        off.max(arc.radius * arc.normal().cross(&self.direction).norm())
    }
}

impl TouchedSphere {
    /// Whether it is not much larger than a rim, nor far from it.
    pub(super) fn is_near(&self, rim: &Rim) -> bool {
        let farthest = FARTHEST * rim.radius;
        self.radius < farthest && (self.height - rim.height).abs() < farthest
    }

    /// The sphere of which an edgel would be the outline.
    pub(super) fn by(axis: &AxisLine, camera: &Camera, edgel: &Edgel) -> Option<Self> {
        let pixel: Vector2<f64> = edgel.position.cast();
        let across: Vector2<f64> = edgel.normal.cast();
        let sight = camera.ray_through(&pixel).direction;
        let beside = camera.ray_through(&(pixel + Vector2::new(-across.y, across.x)));
        let normal = sight.cross(&beside.direction).try_normalize(0.0)?;
        // Where the sight line meets the plane through the axis in which the normal lies.
        let aside = normal.cross(&axis.direction);
        let from = camera.center_in_world - axis.origin;
        let t = -from.dot(&aside) / sight.dot(&aside);
        let point = from + t * sight;
        let height = axis.direction.dot(&point);
        let outward = point - height * axis.direction;
        let radius = outward.norm();
        let across = normal.dot(&outward) / radius;
        let along = normal.dot(&axis.direction) * across.signum();
        let usable = t > 0.0 && (COSINES[0]..COSINES[1]).contains(&along.abs());
        usable.then(|| Self {
            height: height - radius * along / across.abs(),
            radius: radius / across.abs(),
            along,
        })
    }
}

/// The spheres around which most of all lie, by the size of a rim.
pub(super) fn most_voted(rim: &Rim, spheres: &[TouchedSphere]) -> Vec<[f64; 2]> {
    let cell = rim.radius / CELLS;
    let count = (FARTHEST * CELLS) as usize;
    let columns = 2 * count;
    let mut votes = vec![0_u32; columns * count];
    for TouchedSphere { height, radius, .. } in spheres {
        let column = (height - rim.height) / cell + count as f64;
        let row = radius / cell;
        if column >= 0.0 && column < columns as f64 && row < count as f64 {
            votes[row as usize * columns + column as usize] += 1;
        }
    }
    let around = |place: usize, reach: usize| {
        let (row, column) = (place / columns, place % columns);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(count);
        rows.flat_map(move |row| {
            let cells = column.saturating_sub(reach)..(column + reach + 1).min(columns);
            cells.map(move |column| row * columns + column)
        })
    };
    let summed: Vec<u32> = (0..votes.len())
        .map(|place| around(place, 1).map(|beside| votes[beside]).sum())
        .collect();
    // Of equal ones the first.
    let is_peak = |place: &usize| {
        summed[*place] >= MIN_VOTES
            && around(*place, 2).all(|beside| {
                (summed[beside], usize::MAX - beside) <= (summed[*place], usize::MAX - *place)
            })
    };
    let mut peaks: Vec<usize> = (0..summed.len()).filter(is_peak).collect();
    peaks.sort_by_key(|place| u32::MAX - summed[*place]);
    peaks.truncate(MOST);
    let sphere = |place: usize| {
        let column = (place % columns) as f64 + 0.5 - count as f64;
        let row = (place / columns) as f64 + 0.5;
        [rim.height + column * cell, row * cell]
    };
    peaks.into_iter().map(sphere).collect()
}

/// The sphere that those about like it touch on the whole, where edgels are as far off the tangent plane as
/// they are in the image: how an edgel is turned plays no role there.
pub(super) fn agreed(
    [mut height, mut radius]: [f64; 2],
    spheres: &[TouchedSphere],
    rim: &Rim,
    pixel: f64,
) -> Option<[f64; 2]> {
    let near = BESIDE_IN_CELLS * rim.radius / CELLS;
    for _ in 0..AGREEING_ROUNDS {
        let beside = spheres.iter().filter(|sphere| {
            (sphere.height - height).abs() <= near && (sphere.radius - radius).abs() <= near
        });
        let rows: Vec<(Vector2<f64>, f64)> = beside
            .map(|sphere| {
                let aside = sphere.radius - radius + (sphere.height - height) * sphere.along;
                (Vector2::new(sphere.along, 1.0), aside)
            })
            .collect();
        let loss = Cauchy { scale: pixel };
        let ridge = RIDGE * rows.len() as f64;
        let change = reweighted(&rows, loss, ridge)?.solution;
        height += change[0];
        radius += change[1];
    }
    Some([height, radius])
}
