//! Where a face lies in space: what a ray hits.

use super::cells::polygon_of;
use super::curves::Curves;
use super::face::{Face, Surface};
use super::plane_fit::PlaneFrame;
use super::polygon::contains;
use nalgebra::{Vector2, Vector3};
use neat_core::CircularArc;

/// A face is asked about on a grid of so many points to each side of the box around it.
const GRID: usize = 8;

/// A face with its extent.
pub(super) enum Region {
    Plane {
        frame: PlaneFrame,
        polygons: Vec<Vec<Vector2<f64>>>,
    },
    Cylinder {
        /// The rim at height 0, around the axis.
        rim: CircularArc,
        height: f64,
    },
}

impl Region {
    /// `None` if the face is no part of a surface with an extent.
    pub fn new(curves: &Curves, face: &Face) -> Option<Self> {
        match face.surface {
            Surface::Plane { normal, offset } => {
                let frame = PlaneFrame::new(normal, offset);
                let polygon = |steps: &Vec<_>| polygon_of(curves, steps, &frame);
                Some(Self::Plane {
                    frame,
                    polygons: face.loops.iter().map(polygon).collect(),
                })
            }
            Surface::Cylinder {
                axis,
                point,
                radius,
                ..
            } => {
                let mut rims = face.steps().filter_map(|step| curves.find(step.curve)?.arc);
                let [one, other] = [rims.next()?, rims.next()?];
                let center = |arc: &CircularArc| point + axis * axis.dot(&(arc.center - point));
                let along = center(&other) - center(&one);
                let height = along.norm();
                // Angles run as on the arc, wherever the axis points.
                let normal = one.normal().dot(&along).signum() * along / height;
                let x = (one.axes[0] - normal * normal.dot(&one.axes[0])).normalize();
                let rim = CircularArc {
                    center: center(&one),
                    axes: [x, normal.cross(&x)],
                    radius,
                    angles: one.angles,
                };
                let height = along.dot(&rim.normal());
                Some(Self::Cylinder { rim, height })
            }
        }
    }

    /// Where a ray hits the face, by its parameter; ascending on a cylinder.
    pub fn hits(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> [Option<f64>; 2] {
        match self {
            Self::Plane { frame, polygons } => {
                let slope = frame.normal.dot(direction);
                let t = (frame.offset - frame.normal.dot(origin)) / slope;
                let point = frame.coordinates(&(origin + direction * t));
                let inside = polygons.iter().filter(|p| contains(p, &point)).count() % 2 == 1;
                [(t.is_finite() && inside).then_some(t), None]
            }
            Self::Cylinder { rim, height } => {
                let axis = rim.normal();
                let flat = |v: Vector3<f64>| v - axis * axis.dot(&v);
                let (from, along) = (flat(origin - rim.center), flat(*direction));
                let (a, b) = (along.norm_squared(), from.dot(&along));
                let root = (b * b - a * (from.norm_squared() - rim.radius.powi(2))).sqrt();
                let range = [height.min(0.0), height.max(0.0)];
                [-1.0, 1.0].map(|sign| {
                    let t = (sign * root - b) / a;
                    let point = origin + direction * t;
                    let h = axis.dot(&(point - rim.center));
                    let on_face = t.is_finite()
                        && (range[0]..=range[1]).contains(&h)
                        && rim.contains(rim.angle_of(&point), 0.0);
                    on_face.then_some(t)
                })
            }
        }
    }

    /// Whether a straight line from one point to another passes through the face.
    pub fn is_between(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let hits = self.hits(from, &(to - from));
        hits.iter().flatten().any(|t| (0.0..1.0).contains(t))
    }

    /// Points all over a plane face; none of a cylinder.
    pub fn points(&self) -> Vec<Vector3<f64>> {
        let Self::Plane { frame, polygons } = self else {
            return Vec::new();
        };
        let corners = || polygons.iter().flatten();
        let low = corners().fold(Vector2::repeat(f64::MAX), |low, corner| low.inf(corner));
        let high = corners().fold(Vector2::repeat(f64::MIN), |high, corner| high.sup(corner));
        let at = |k: usize| {
            let share = [k % GRID, k / GRID].map(|k| (k as f64 + 0.5) / GRID as f64);
            low + (high - low).component_mul(&Vector2::from(share))
        };
        let inside = |p: &Vector2<f64>| polygons.iter().filter(|q| contains(q, p)).count() % 2 == 1;
        let points = (0..GRID * GRID).map(at).filter(inside);
        points.map(|point| frame.point(&point)).collect()
    }

    /// Distance of a point from the surface of which the face is a part.
    pub fn distance_to_surface(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Plane { frame, .. } => (frame.normal.dot(point) - frame.offset).abs(),
            Self::Cylinder { rim, .. } => {
                let offset = point - rim.center;
                let from_axis = (offset - rim.normal() * rim.normal().dot(&offset)).norm();
                (from_axis - rim.radius).abs()
            }
        }
    }

    /// Whether a point lies over or under the face itself, at most `distance` away.
    pub fn is_near(&self, point: &Vector3<f64>, distance: f64) -> bool {
        let toward = match self {
            Self::Plane { frame, .. } => frame.normal,
            Self::Cylinder { rim, .. } => rim.toward(rim.angle_of(point)),
        };
        let hits = self.hits(point, &toward);
        hits.iter().flatten().any(|t| t.abs() <= distance)
    }
}
