//! Corners that many views place at the same point of space: the evidence in
//! images of things without texture.
//!
//! Corners of uniform faces look alike, so they cannot be matched. But with the
//! right cameras the rays through the images of one corner meet, and a point
//! where two rays meet is confirmed by a corner in many other views, far more
//! often than chance allows. With wrong cameras hardly any point is.

use crate::agreement::{Agreement, PairTallies, Tally};
use crate::lens::straightened;
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Ray};

/// The corners of some views of a scene.
pub(crate) struct CornerEvidence {
    views: Vec<ViewCorners>,
}

/// The corners of one view.
pub(crate) struct ViewCorners {
    /// Index of the view.
    view: usize,
    /// Image coordinates.
    corners: Vec<Vector2<f64>>,
    /// How far from a projection a corner may be, in pixels.
    tolerance: f64,
    /// The rectangle that holds all corners.
    lower: Vector2<f64>,
    upper: Vector2<f64>,
    /// Cells of half the tolerance over the rectangle, row by row: one more than
    /// the index of the corner within the tolerance of the cell, 0 for none.
    cells: Vec<u8>,
    columns: usize,
    /// The share of cells that are not 0.
    chance: f64,
}

/// More corners in a view than these say nothing more.
pub(crate) const MAX_CORNERS: usize = 48;
/// The tolerance as a share of the larger side of the image: 2 pixels of 512.
const TOLERANCE: f64 = 0.004;
/// Views that a view is paired with, by the difference of their numbers:
/// Fibonacci numbers, so that captures in any order have neighbours among them.
const PARTNERS: [usize; 8] = [1, 2, 3, 5, 8, 13, 21, 34];
/// Rays that meet at a smaller angle do not tell the depth; 4°.
const MAX_COSINE: f64 = 0.9976;
/// A point is accepted if chance confirms it this seldom.
const MAX_CHANCE: f64 = 1e-7;

impl ViewCorners {
    /// `larger_side` is that of the image in pixels. Corners beyond
    /// [`MAX_CORNERS`] are left out.
    pub fn new(view: usize, mut corners: Vec<Vector2<f64>>, larger_side: f64) -> Self {
        corners.truncate(MAX_CORNERS);
        let tolerance = (TOLERANCE * larger_side).max(1.0);
        let margin = 2.0 * tolerance;
        let bounds = |start: f64, pick: fn(f64, f64) -> f64| {
            let fold = |axis: usize| corners.iter().map(|c| c[axis]).fold(start, pick);
            Vector2::new(fold(0), fold(1))
        };
        let lower = bounds(f64::INFINITY, f64::min).add_scalar(-margin);
        let upper = bounds(f64::NEG_INFINITY, f64::max).add_scalar(margin);
        let mut this = Self {
            view,
            tolerance,
            lower,
            upper,
            cells: Vec::new(),
            columns: 0,
            chance: 0.0,
            corners,
        };
        if !this.corners.is_empty() {
            this.fill_cells();
        }
        this
    }

    fn fill_cells(&mut self) {
        let cell = 0.5 * self.tolerance;
        let size = (self.upper - self.lower) / cell;
        self.columns = size.x.ceil() as usize + 1;
        let rows = size.y.ceil() as usize + 1;
        self.cells = vec![0; self.columns * rows];
        // How far the corner of each cell is from its middle.
        let mut distances = vec![self.tolerance; self.cells.len()];
        // A disc of the tolerance reaches over two cells to each side, and its own.
        let reach = |middle: f64| {
            let first = (middle - 2.5).floor().max(0.0) as usize;
            first..first + 6
        };
        for (index, corner) in self.corners.iter().enumerate() {
            let at = (corner - self.lower) / cell;
            for row in reach(at.y).take_while(|row| *row < rows) {
                for column in reach(at.x).take_while(|column| *column < self.columns) {
                    let middle = Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * cell;
                    let distance = (corner - self.lower - middle).norm();
                    let place = row * self.columns + column;
                    if distance < distances[place] {
                        distances[place] = distance;
                        self.cells[place] = index as u8 + 1;
                    }
                }
            }
        }
        let covered = self.cells.iter().filter(|&&cell| cell != 0).count();
        self.chance = covered as f64 / self.cells.len() as f64;
    }

    /// Whether `pixel` is where this view has corners at all, and the index of
    /// the corner that is there.
    fn look_up(&self, pixel: &Vector2<f64>) -> Option<Option<usize>> {
        let inside = pixel.x > self.lower.x
            && pixel.y > self.lower.y
            && pixel.x < self.upper.x
            && pixel.y < self.upper.y;
        if !inside {
            return None;
        }
        let cell = (pixel - self.lower) / (0.5 * self.tolerance);
        let index = cell.y as usize * self.columns + cell.x as usize;
        let corner = self.cells.get(index).copied().unwrap_or(0);
        Some(usize::from(corner).checked_sub(1))
    }
}

impl CornerEvidence {
    pub fn new(views: Vec<ViewCorners>) -> Self {
        Self { views }
    }

    /// The corners as pinholes see them, in place of a lens of this strength.
    pub fn straightened(&self, cameras: &[Camera], strength: f64) -> Self {
        let views = self.views.iter().map(|view| {
            let camera = &cameras[view.view];
            let corners = view.corners.iter();
            let corners = corners.map(|corner| straightened(corner, camera, strength));
            let larger_side = f64::from(camera.width.max(camera.height));
            ViewCorners::new(view.view, corners.collect(), larger_side)
        });
        Self::new(views.collect())
    }

    /// The share of corners that belong to a point of space which the trusted
    /// views confirm. Corners of other views count only where they are asked
    /// for one by one.
    pub fn agreement(&self, cameras: &[Camera], trusted: &[bool]) -> Agreement {
        let views: Vec<&ViewCorners> = (self.views.iter())
            .filter(|view| trusted[view.view])
            .collect();
        // The best fit of each corner, in [0, 1].
        let mut fits: Vec<Vec<f64>> = (views.iter())
            .map(|view| vec![0.0; view.corners.len()])
            .collect();
        let mut agreement = Agreement::none(cameras.len());
        for_each_confirmed(&views, cameras, |_, hits| {
            for &(view, corner, fit) in hits {
                agreement.score += fit;
                let best: &mut f64 = &mut fits[view][corner];
                *best = best.max(fit);
            }
        });
        for (view, fits) in views.iter().zip(fits) {
            for fit in fits {
                let tally = Tally::one(fit > 0.0);
                agreement.all += tally;
                agreement.per_view[view.view] += tally;
            }
        }
        agreement
    }

    /// For each two views how many of the points that the one confirms, and the other could,
    /// both do.
    pub fn in_common(&self, cameras: &[Camera], trusted: &[bool]) -> PairTallies {
        let views: Vec<&ViewCorners> = (self.views.iter())
            .filter(|view| trusted[view.view])
            .collect();
        let mut pairs = PairTallies::new(cameras.len());
        for_each_confirmed(&views, cameras, |point, hits| {
            for (index, view) in views.iter().enumerate() {
                let projection = cameras[view.view].project(point);
                if projection.depth <= 0.0 || view.look_up(&projection.pixel).is_none() {
                    continue;
                }
                let own = hits.iter().any(|(hit, ..)| *hit == index);
                for (other, ..) in hits.iter().filter(|(hit, ..)| *hit != index) {
                    pairs.add([view.view, views[*other].view], Tally::one(own));
                }
            }
        });
        pairs
    }
}

/// Visits the points where the corners of two views meet that others confirm, with the view,
/// the corner and the fit of each of their images.
fn for_each_confirmed(
    views: &[&ViewCorners],
    cameras: &[Camera],
    mut visit: impl FnMut(&Vector3<f64>, &[(usize, usize, f64)]),
) {
    let rays: Vec<Vec<Ray>> = (views.iter())
        .map(|view| {
            let ray = |corner| cameras[view.view].ray_through(corner);
            view.corners.iter().map(ray).collect()
        })
        .collect();
    let mut hits = Vec::new();
    for first in 0..views.len() {
        for offset in PARTNERS {
            let second = first + offset;
            if second >= views.len() {
                break;
            }
            let pair = [first, second];
            let geometry = PairGeometry::new(views, cameras, pair);
            for a in 0..views[first].corners.len() {
                for b in 0..views[second].corners.len() {
                    let Some(point) = geometry.meeting(views, &rays, [a, b]) else {
                        continue;
                    };
                    hits.clear();
                    if confirmed(views, cameras, pair, &point, &mut hits) {
                        visit(&point, &hits);
                    }
                }
            }
        }
    }
}

/// The epipolar geometry of two views.
struct PairGeometry<'a> {
    cameras: [&'a Camera; 2],
    /// Leads from a pixel of the first view to its epipolar line in the second.
    fundamental: Matrix3<f64>,
    pair: [usize; 2],
}

impl<'a> PairGeometry<'a> {
    fn new(views: &[&ViewCorners], cameras: &'a [Camera], pair: [usize; 2]) -> Self {
        let cameras = pair.map(|index| &cameras[views[index].view]);
        let [first, second] = cameras;
        // x₂ᵀ K₂⁻ᵀ R₂ᵀ [c₁ − c₂]ₓ R₁ K₁⁻¹ x₁ = 0.
        let inverse = |camera: &Camera| {
            let k = camera.intrinsics.matrix();
            k.try_inverse().unwrap_or_else(Matrix3::identity)
        };
        let baseline = first.center_in_world - second.center_in_world;
        let fundamental = inverse(second).transpose()
            * second.world_from_camera.transpose()
            * baseline.cross_matrix()
            * first.world_from_camera
            * inverse(first);
        Self {
            cameras,
            fundamental,
            pair,
        }
    }

    /// Where the rays through corner a of the first view and b of the second
    /// meet, if they do, in front of both.
    fn meeting(
        &self,
        views: &[&ViewCorners],
        rays: &[Vec<Ray>],
        [a, b]: [usize; 2],
    ) -> Option<Vector3<f64>> {
        let [first, second] = self.pair;
        let line = self.fundamental * views[first].corners[a].push(1.0);
        let off = line.dot(&views[second].corners[b].push(1.0)).abs();
        if off > 1.5 * views[second].tolerance * line.xy().norm() {
            return None;
        }
        let (ray_a, ray_b) = (&rays[first][a], &rays[second][b]);
        if ray_a.direction.dot(&ray_b.direction).abs() > MAX_COSINE {
            return None;
        }
        let point = ray_a.meeting(ray_b)?;
        let near = |side: usize, corner: usize| {
            let view = views[self.pair[side]];
            let projection = self.cameras[side].project(&point);
            projection.depth > 0.0
                && (projection.pixel - view.corners[corner]).norm() < view.tolerance
        };
        (near(0, a) && near(1, b)).then_some(point)
    }
}

/// Whether views other than `pair` have a corner where `point` projects to, more
/// often than by chance. `hits` gets view, corner and fit of each, the pair's
/// too.
fn confirmed(
    views: &[&ViewCorners],
    cameras: &[Camera],
    pair: [usize; 2],
    point: &Vector3<f64>,
    hits: &mut Vec<(usize, usize, f64)>,
) -> bool {
    let mut expected = 0.0;
    let mut found = 0;
    for (index, view) in views.iter().enumerate() {
        let projection = cameras[view.view].project(point);
        if projection.depth <= 0.0 {
            continue;
        }
        let Some(corner) = view.look_up(&projection.pixel) else {
            continue;
        };
        let others = !pair.contains(&index);
        if others {
            expected += view.chance;
        }
        if let Some(corner) = corner {
            let off = (projection.pixel - view.corners[corner]).norm() / view.tolerance;
            // Cells are coarse; what is just outside the tolerance counts little.
            hits.push((index, corner, (1.0 - off * off).max(0.01)));
            found += usize::from(others);
        }
    }
    found >= 3 && poisson_tail(found, expected) < MAX_CHANCE
}

/// The probability of `count` or more events where `expected` are expected.
fn poisson_tail(count: usize, expected: f64) -> f64 {
    let mut term = (-expected).exp();
    for k in 1..=count {
        term *= expected / k as f64;
    }
    // The terms fall at least geometrically beyond the mean.
    let mut sum = 0.0;
    for k in count..count + 60 {
        sum += term;
        term *= expected / (k + 1) as f64;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_poisson_tail_is_that_of_tables() {
        assert!((poisson_tail(0, 2.0) - 1.0).abs() < 1e-12);
        assert!((poisson_tail(1, 0.5) - 0.393_469_340_287_366_6).abs() < 1e-12);
        assert!((poisson_tail(4, 1.0) - 0.018_988_156_876_153_8).abs() < 1e-12);
    }

    #[test]
    fn a_view_knows_where_its_corners_are() {
        let corners = vec![Vector2::new(10.0, 20.0), Vector2::new(100.0, 90.0)];
        let view = ViewCorners::new(0, corners, 512.0);
        assert_eq!(view.look_up(&Vector2::new(10.8, 20.5)), Some(Some(0)));
        assert_eq!(view.look_up(&Vector2::new(50.0, 50.0)), Some(None));
        assert_eq!(view.look_up(&Vector2::new(300.0, 50.0)), None);
        let nothing = ViewCorners::new(0, Vec::new(), 512.0);
        assert_eq!(nothing.look_up(&Vector2::new(1.0, 1.0)), None);
    }
}
