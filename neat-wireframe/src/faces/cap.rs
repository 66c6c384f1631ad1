//! Caps of spheres: what is beyond a plane.

use super::plane_fit::across;
use super::round_triangulation::{Corner, Ring, between};
use super::surface::Surface;
use nalgebra::{Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// Points within a cap turn by so much from one to the next, in radians: as those along its rim.
const TURN: f64 = 0.15;

/// A part of a sphere within one circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cap {
    center: Vector3<f64>,
    radius: f64,
    /// From the centre to the pole.
    axis: Vector3<f64>,
    /// Of the plane of the circle over the centre, by the axis.
    height: f64,
    /// Whether its normal points away from the centre.
    convex: bool,
}

impl Cap {
    /// To the left of a loop, which ends where it begins, around a sphere; `None` of other surfaces.
    pub fn new(surface: &Surface, around: &[Vector3<f64>]) -> Option<Self> {
        let Surface::Sphere {
            center,
            radius,
            convex,
        } = *surface
        else {
            return None;
        };
        let offsets: Vec<Vector3<f64>> = around.iter().map(|point| point - center).collect();
        let pairs = offsets.windows(2);
        let area: Vector3<f64> = pairs.map(|ends| ends[0].cross(&ends[1])).sum();
        let turns = area.try_normalize(0.0)?;
        let axis = if convex { turns } else { -turns };
        let heights = offsets.iter().map(|offset| axis.dot(offset));
        let height = heights.sum::<f64>() / offsets.len() as f64;
        (height.abs() < radius).then_some(Self {
            center,
            radius,
            axis,
            height,
            convex,
        })
    }

    /// The angle from the pole to the rim.
    fn reach(&self) -> f64 {
        (self.height / self.radius).acos()
    }

    fn point(&self, place: &Vector2<f64>) -> Vector3<f64> {
        let [x, y] = across(&self.axis);
        let (sine, cosine) = place.norm().sin_cos();
        let outward = place.try_normalize(0.0).unwrap_or_default();
        let aside = x * outward.x + y * outward.y;
        self.center + self.radius * (cosine * self.axis + sine * aside)
    }

    /// The angle from the pole, in the direction from it.
    fn place(&self, point: &Vector3<f64>) -> Vector2<f64> {
        let offset = point - self.center;
        let flat = Vector2::from(across(&self.axis).map(|axis| axis.dot(&offset)));
        let angle = flat.norm().atan2(self.axis.dot(&offset));
        angle * flat.try_normalize(0.0).unwrap_or_default()
    }

    /// Where a ray meets it, by its parameter.
    pub fn hits(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Vec<f64> {
        let from = origin - self.center;
        let (a, b) = (direction.norm_squared(), from.dot(direction));
        let c = from.norm_squared() - self.radius * self.radius;
        let root = (b * b - a * c).sqrt();
        let hits = [-(b + root) / a, (root - b) / a].into_iter();
        hits.filter(|t| t.is_finite() && self.axis.dot(&(from + direction * *t)) >= self.height)
            .collect()
    }

    /// The distance of a point from the sphere.
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        ((point - self.center).norm() - self.radius).abs()
    }

    /// The direction away from the centre.
    pub fn outward(&self, point: &Vector3<f64>) -> Vector3<f64> {
        (point - self.center).normalize()
    }

    /// Pieces of one of so many lines from the rim to the pole, all but their ends.
    pub fn pieces_at(&self, line: usize, lines: usize, at_end: f64) -> Vec<[Vector3<f64>; 2]> {
        /// A quarter of a sphere is followed to a hundredth of its radius.
        const PIECES: usize = 6;
        let (sine, cosine) = (TAU * (line as f64 + 0.5) / lines as f64).sin_cos();
        let at = |k: usize| {
            let share = at_end + (1.0 - 2.0 * at_end) * k as f64 / PIECES as f64;
            self.point(&(self.reach() * share * Vector2::new(cosine, sine)))
        };
        (0..PIECES).map(|k| [at(k), at(k + 1)]).collect()
    }

    /// Area, and the flux through it of x from a point.
    pub fn moments(&self, from: &Vector3<f64>) -> [f64; 2] {
        let area = TAU * self.radius * (self.radius - self.height);
        let disc = PI * (self.radius * self.radius - self.height * self.height);
        let flux = disc * self.axis.dot(&(self.center - from)) + area * self.radius;
        [area, if self.convex { flux } else { -flux }]
    }

    /// Points within it, the pole first.
    pub fn inner_points(&self) -> Vec<Vector3<f64>> {
        self.inner_places()
            .iter()
            .map(|place| self.point(place))
            .collect()
    }

    fn inner_places(&self) -> Vec<Vector2<f64>> {
        let reach = self.reach();
        let rings = (reach / TURN).ceil().max(1.0);
        let ring = |k: usize| {
            let angle = reach * k as f64 / rings;
            let count = (TAU * angle.sin() / TURN).ceil().max(6.0) as usize;
            (0..count).map(move |i| {
                let (sine, cosine) = (TAU * i as f64 / count as f64).sin_cos();
                angle * Vector2::new(cosine, sine)
            })
        };
        let around = (1..rings as usize).flat_map(ring);
        std::iter::once(Vector2::zeros()).chain(around).collect()
    }

    /// Its triangles, with [`Self::inner_points`] from an index on.
    pub fn triangles(
        &self,
        rim: &[usize],
        points: &[Vector3<f64>],
        first: usize,
    ) -> Vec<[usize; 3]> {
        let corner = |index: usize, place: Vector2<f64>| Corner { index, place };
        let ring: Ring = (rim.iter())
            .map(|index| corner(*index, self.place(&points[*index])))
            .collect();
        let inner = self.inner_places().into_iter().enumerate();
        let inner: Vec<Corner> = inner.map(|(k, place)| corner(first + k, place)).collect();
        let cut = between(&[ring], &inner).unwrap_or_default().into_iter();
        // Seen from outside of the sphere, places turn as they do in their plane.
        cut.map(|[a, b, c]| if self.convex { [a, b, c] } else { [a, c, b] })
            .collect()
    }
}
