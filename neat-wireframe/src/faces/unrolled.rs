//! Cylinders and cones unrolled: angles around the axis and heights along it.
//!
//! Seen from away from the axis, with the axis upward, angles grow to the right: a loop that keeps
//! the face on its left runs as in a plane, or once around the axis, to the right below the face
//! and to the left above it.

use super::plane_fit::across;
use super::quadrature::GAUSS;
use super::surface::Surface;
use nalgebra::{Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// An angle and a height for each point of a chain. From one to the next angles change by less than
/// half a turn, so that they may grow beyond a whole one.
pub(crate) type Chain = Vec<Vector2<f64>>;

/// A round surface with an angle and a height for each point.
pub(crate) struct Unrolled {
    surface: Surface,
    origin: Vector3<f64>,
    axis: Vector3<f64>,
    across: [Vector3<f64>; 2],
    /// At height 0, and by how much it grows with the height.
    radius: f64,
    slope: f64,
}

impl Unrolled {
    /// `None` of a plane.
    pub fn new(surface: &Surface) -> Option<Self> {
        let (origin, axis) = surface.axis()?;
        let [radius, slope] = surface.radius_at(&origin, &axis)?;
        Some(Self {
            surface: *surface,
            origin,
            axis,
            across: across(&axis),
            radius,
            slope,
        })
    }

    pub fn radius_at(&self, height: f64) -> f64 {
        self.radius + self.slope * height
    }

    /// By how much its way along a ruling is longer than along the axis.
    pub fn slant(&self) -> f64 {
        self.slope.hypot(1.0)
    }

    /// From -π to π, and the height.
    pub fn place(&self, point: &Vector3<f64>) -> Vector2<f64> {
        let offset = point - self.origin;
        let [u, v] = self.across.map(|axis| axis.dot(&offset));
        Vector2::new(v.atan2(u), self.axis.dot(&offset))
    }

    /// The direction away from the axis.
    pub fn outward(&self, angle: f64) -> Vector3<f64> {
        let (sine, cosine) = angle.sin_cos();
        self.across[0] * cosine + self.across[1] * sine
    }

    /// The point of the surface.
    pub fn point(&self, place: &Vector2<f64>) -> Vector3<f64> {
        let along = self.origin + self.axis * place.y;
        along + self.outward(place.x) * self.radius_at(place.y)
    }

    /// The distance of a point from the surface.
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        self.surface.height_of(point).0.abs()
    }

    /// The angle of a direction that leads on along the surface from a point: 0 to the right.
    pub fn direction(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
        let (along, up) = (to - from, self.axis.dot(&(to - from)));
        let right = self.axis.cross(&self.outward(self.place(from).x));
        up.atan2(right.dot(&along))
    }

    pub fn chain<'a>(&self, points: impl IntoIterator<Item = &'a Vector3<f64>>) -> Chain {
        let mut last = None;
        let places = points.into_iter().map(|point| {
            let mut place = self.place(point);
            if let Some(last) = last {
                place.x = last + turn(last, place.x);
            }
            last = Some(place.x);
            place
        });
        places.collect()
    }

    /// Where a ray meets the surface, by its parameter, with the places there.
    pub fn hits(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
    ) -> [Option<(f64, Vector2<f64>)>; 2] {
        let flat = |v: &Vector3<f64>| v - self.axis * self.axis.dot(v);
        let offset = origin - self.origin;
        // Distance from the axis less radius, both squared, is a t² + 2 b t + c.
        let radius = self.radius_at(self.axis.dot(&offset));
        let widens = self.slope * self.axis.dot(direction);
        let (from, along) = (flat(&offset), flat(direction));
        let a = along.norm_squared() - widens * widens;
        let b = from.dot(&along) - radius * widens;
        let c = from.norm_squared() - radius * radius;
        let root = (b * b - a * c).sqrt().copysign(b);
        let hits = [-(b + root) / a, -c / (b + root)];
        hits.map(|t| {
            let place = self.place(&(origin + direction * t));
            let on_surface = t.is_finite() && self.radius_at(place.y) > 0.0;
            on_surface.then_some((t, place))
        })
    }

    /// The pieces of the ruling at an angle that are within loops.
    pub fn pieces_at(&self, loops: &[Chain], angle: f64) -> Vec<[Vector3<f64>; 2]> {
        let point = |height: f64| self.point(&Vector2::new(angle, height));
        let heights = crossings(loops, angle);
        let pieces = heights.chunks_exact(2);
        pieces
            .map(|ends| [point(ends[0]), point(ends[1])])
            .collect()
    }

    /// The angles at which the surface turns away from a point; `None` where all or nothing of it is seen
    /// from there.
    pub fn outline_angles(&self, from: &Vector3<f64>) -> Option<[f64; 2]> {
        let place = self.place(from);
        let flat = (from - self.origin) - self.axis * place.y;
        let half = (self.radius_at(place.y) / flat.norm()).acos();
        half.is_finite().then_some([place.x - half, place.x + half])
    }

    /// Area of a face within loops, which end where they begin, and the flux through it of x from a
    /// point, away from the axis: by Gauss' theorem as integrals over the angle around it.
    pub fn moments(&self, loops: &[Chain], from: &Vector3<f64>) -> [f64; 2] {
        let offset = self.origin - from;
        let apex = self.radius - self.slope * self.axis.dot(&offset);
        // Over heights, of the radius.
        let below = |height: f64| height * (self.radius + 0.5 * self.slope * height);
        let mut moments = [0.0, 0.0];
        for [start, end] in loops.iter().flat_map(pieces) {
            for (share, weight) in GAUSS {
                let place = start + (end - start) * share;
                let share = (start.x - end.x) * weight * below(place.y);
                moments[0] += share * self.slant();
                moments[1] += share * (apex + self.outward(place.x).dot(&offset));
            }
        }
        moments
    }
}

/// The way from one angle to another, from -π to π.
pub(super) fn turn(from: f64, to: f64) -> f64 {
    (to - from + PI).rem_euclid(TAU) - PI
}

/// How often a loop that ends where it begins runs around the axis, to the right.
pub(super) fn turns(chain: &Chain) -> i32 {
    match (chain.first(), chain.last()) {
        (Some(first), Some(last)) => ((last.x - first.x) / TAU).round() as i32,
        _ => 0,
    }
}

/// Whether loops have the place within them: an odd number of times they pass over it.
pub(super) fn contains(loops: &[Chain], place: &Vector2<f64>) -> bool {
    let above = heights_at(loops, place.x).filter(|height| *height > place.y);
    above.count() % 2 == 1
}

/// The heights at which loops pass an angle, ascending.
fn crossings(loops: &[Chain], angle: f64) -> Vec<f64> {
    let mut heights: Vec<f64> = heights_at(loops, angle).collect();
    heights.sort_by(f64::total_cmp);
    heights
}

fn heights_at(loops: &[Chain], angle: f64) -> impl Iterator<Item = f64> + '_ {
    let turned = move |place: &Vector2<f64>| ((place.x - angle) / TAU).floor();
    let passing = loops.iter().flat_map(pieces);
    passing.filter_map(move |[a, b]| {
        let turns = [turned(&a), turned(&b)];
        let at = angle + TAU * turns[0].max(turns[1]);
        (turns[0] != turns[1]).then(|| a.y + (b.y - a.y) * (at - a.x) / (b.x - a.x))
    })
}

fn pieces(chain: &Chain) -> impl Iterator<Item = [Vector2<f64>; 2]> + '_ {
    chain.windows(2).map(|ends| [ends[0], ends[1]])
}
