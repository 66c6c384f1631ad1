//! Where a face lies in space: what a ray hits.

use super::cells::{closed_points, polygon_of};
use super::curves::Curves;
use super::face::{Face, Step};
use super::plane_fit::PlaneFrame;
use super::polygon::contains;
use super::surface::Surface;
use super::unrolled::{self, Chain, Unrolled};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::TAU;

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
        surface: Unrolled,
        loops: Vec<Chain>,
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
                let surface = Unrolled::new(&round)?;
                let around = |steps: &Vec<Step>| surface.chain(&closed_points(curves, steps));
                let loops: Vec<Chain> = face.loops.iter().map(around).collect();
                Some(Self::Round { surface, loops })
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
            Self::Round { surface, loops } => {
                let hits = surface.hits(origin, direction);
                hits.map(|hit| Some(hit.filter(|(_, place)| unrolled::contains(loops, place))?.0))
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
        let Self::Round { surface, loops } = self else {
            return false;
        };
        let angles = || loops.iter().flatten().map(|place| place.x);
        let from = angles().fold(f64::MAX, f64::min);
        let sweep = (angles().fold(f64::MIN, f64::max) - from).min(TAU);
        let passes = |ruling: &usize| {
            let angle = from + sweep * (*ruling as f64 + 0.5) / RULINGS as f64;
            let heights = unrolled::crossings(loops, angle);
            heights.chunks_exact(2).any(|ends| {
                let at = |share: f64| {
                    let height = ends[0] + (ends[1] - ends[0]) * share;
                    surface.point(&Vector2::new(angle, height))
                };
                other.is_between(&at(AT_END), &at(1.0 - AT_END))
            })
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
            Self::Round { surface, .. } => surface.distance(point),
        }
    }

    /// Where a chain of points near the face lies on it, in lengths.
    pub fn unrolled(&self, points: impl Iterator<Item = Vector3<f64>>) -> Vec<Vector2<f64>> {
        match self {
            Self::Plane { frame, .. } => points.map(|point| frame.coordinates(&point)).collect(),
            Self::Round { surface, .. } => {
                let mut chain = surface.chain(&points.collect::<Vec<_>>());
                (chain.iter_mut()).for_each(|place| place.x *= surface.radius_at(place.y));
                chain
            }
        }
    }

    /// Whether a point lies over or under the face itself, at most `distance` away.
    pub fn is_near(&self, point: &Vector3<f64>, distance: f64) -> bool {
        let toward = match self {
            Self::Plane { frame, .. } => frame.normal,
            Self::Round { surface, .. } => surface.outward(surface.place(point).x),
        };
        let hits = self.hits(point, &toward);
        hits.iter().flatten().any(|t| t.abs() <= distance)
    }
}
