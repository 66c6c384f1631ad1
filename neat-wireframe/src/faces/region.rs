//! Where a face lies in space: what a ray hits.

use super::cells::polygon_of;
use super::curves::Curves;
use super::face::Face;
use super::plane_fit::PlaneFrame;
use super::polygon::contains;
use super::surface::Surface;
use nalgebra::{Vector2, Vector3};
use neat_core::CircularArc;

/// A round face is asked about along so many straight lines on it …
const RULINGS: usize = 16;
/// … without this share at each end …
const AT_END: f64 = 0.02;
/// … and passes through another one if more of them do.
const FEW_RULINGS: usize = 4;
/// A face is asked about on a grid of so many points to each side of the box around it.
const GRID: usize = 8;

/// A face with its extent.
pub(super) enum Region {
    Plane {
        frame: PlaneFrame,
        polygons: Vec<Vec<Vector2<f64>>>,
    },
    /// Of a cylinder or a cone.
    Round {
        /// The rim at height 0, around the axis.
        rim: CircularArc,
        height: f64,
        /// By how much the radius grows with the height.
        slope: f64,
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
            round => {
                let (point, axis) = round.axis()?;
                let mut rims = face.steps().filter_map(|step| curves.find(step.curve)?.arc);
                let [one, other] = [rims.next()?, rims.next()?];
                let center = |arc: &CircularArc| point + axis * axis.dot(&(arc.center - point));
                let along = center(&other) - center(&one);
                let height = along.norm();
                // Angles run as on the arc, wherever the axis points.
                let normal = one.normal().dot(&along).signum() * along / height;
                let x = (one.axes[0] - normal * normal.dot(&one.axes[0])).normalize();
                let [radius, slope] = round.radius_at(&one.center, &normal)?;
                let rim = CircularArc {
                    center: center(&one),
                    axes: [x, normal.cross(&x)],
                    radius,
                    angles: one.angles,
                };
                let height = along.dot(&rim.normal());
                Some(Self::Round { rim, height, slope })
            }
        }
    }

    /// Where a ray hits the face, by its parameter; ascending on what is round.
    pub fn hits(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> [Option<f64>; 2] {
        match self {
            Self::Plane { frame, polygons } => {
                let slope = frame.normal.dot(direction);
                let t = (frame.offset - frame.normal.dot(origin)) / slope;
                let point = frame.coordinates(&(origin + direction * t));
                let inside = polygons.iter().filter(|p| contains(p, &point)).count() % 2 == 1;
                [(t.is_finite() && inside).then_some(t), None]
            }
            Self::Round { rim, height, slope } => {
                let axis = rim.normal();
                let flat = |v: Vector3<f64>| v - axis * axis.dot(&v);
                let (from, along) = (origin - rim.center, *direction);
                // Distance from the axis less radius, both squared, is a t² + 2 b t + c.
                let (radius, widens) = (
                    rim.radius + slope * axis.dot(&from),
                    slope * axis.dot(&along),
                );
                let (from, along) = (flat(from), flat(along));
                let a = along.norm_squared() - widens * widens;
                let b = from.dot(&along) - radius * widens;
                let c = from.norm_squared() - radius * radius;
                let root = (b * b - a * c).sqrt().copysign(b);
                let mut hits = [-(b + root) / a, -c / (b + root)];
                hits.sort_by(f64::total_cmp);
                let range = [height.min(0.0), height.max(0.0)];
                hits.map(|t| {
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

    /// Whether a round face passes through another one.
    pub fn passes_through(&self, other: &Self) -> bool {
        let Self::Round { rim, height, slope } = self else {
            return false;
        };
        let passes = |ruling: &usize| {
            let angle = rim.angles[0] + rim.sweep() * (*ruling as f64 + 0.5) / RULINGS as f64;
            let outward = rim.toward(angle);
            let at = |share: f64| {
                let along = share * height;
                rim.center + outward * (rim.radius + slope * along) + rim.normal() * along
            };
            other.is_between(&at(AT_END), &at(1.0 - AT_END))
        };
        (0..RULINGS).filter(passes).count() > FEW_RULINGS
    }

    /// Points all over a plane face; none of a round one.
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
            Self::Round { rim, slope, .. } => {
                let offset = point - rim.center;
                let along = rim.normal().dot(&offset);
                let from_axis = (offset - rim.normal() * along).norm();
                (from_axis - rim.radius - slope * along).abs() / slope.hypot(1.0)
            }
        }
    }

    /// Whether a point lies over or under the face itself, at most `distance` away.
    pub fn is_near(&self, point: &Vector3<f64>, distance: f64) -> bool {
        let toward = match self {
            Self::Plane { frame, .. } => frame.normal,
            Self::Round { rim, .. } => rim.toward(rim.angle_of(point)),
        };
        let hits = self.hits(point, &toward);
        hits.iter().flatten().any(|t| t.abs() <= distance)
    }
}
