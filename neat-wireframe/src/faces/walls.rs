//! Walls between two splines of one shape: what a profile leaves behind that is drawn along a
//! straight line.

use super::candidates::{joined, straight_by_ends};
use super::chain::{distance_to_chain, point_along};
use super::curves::{Curve, Curves};
use super::face::{CurveIndex, Face, Step};
use super::surface::Surface;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Places along a spline at which it is compared with another one.
const PLACES: usize = 32;
/// A wall leaves the planes of its rims by more than this sine: 10°.
pub(super) const FLAT: f64 = 0.174;

/// The walls between two closed splines, or two whose ends straight curves join.
pub(super) fn walls(curves: &Curves) -> Vec<Face> {
    let is_spline = |curve: &&Curve| matches!(curve.index, CurveIndex::Spline(_));
    let splines: Vec<&Curve> = curves.all.iter().filter(is_spline).collect();
    let by_ends = straight_by_ends(curves);
    let pairs = (0..splines.len()).flat_map(|i| (0..i).map(move |j| (j, i)));
    let face = |(i, j): (usize, usize)| {
        let rims = [splines[i], splines[j]];
        let direction = common_direction(curves, rims)?;
        Some(Face {
            surface: Surface::Extruded { direction },
            loops: loops_between(rims, &direction, &by_ends)?,
        })
    };
    pairs.filter_map(face).collect()
}

/// The direction in which the second spline lies from the first, if along it both look the same.
fn common_direction(curves: &Curves, rims: [&Curve; 2]) -> Option<Vector3<f64>> {
    let [from, to] = rims.map(|rim| centroid(&rim.points));
    let tolerance = std::f64::consts::SQRT_2 * curves.arc_sigma();
    let direction = (to - from).try_normalize(tolerance)?;
    let is_upright = |rim: &Curve| {
        let area = area_vector(&rim.points);
        area.dot(&direction).abs() > FLAT * area.norm()
    };
    if !rims.into_iter().all(is_upright) {
        return None;
    }
    let profiles = rims.map(|rim| profile(&rim.points, &direction));
    let is_same = |k: usize| {
        let shares = (0..PLACES).map(|k| (k as f64 + 0.5) / PLACES as f64);
        let places: Vec<Vector3<f64>> = shares
            .map(|share| point_along(&rims[k].points, share))
            .collect();
        let along = profile(&places, &direction);
        along
            .iter()
            .all(|point| distance_to_chain(&profiles[1 - k], point) <= tolerance)
    };
    (is_same(0) && is_same(1)).then_some(direction)
}

/// Around the profile along the first rim, with the second one to the left, and back along that.
fn loops_between(
    rims: [&Curve; 2],
    direction: &Vector3<f64>,
    edges: &BTreeMap<[usize; 2], &Curve>,
) -> Option<Vec<Vec<Step>>> {
    let reversed = |rim: &Curve| area_vector(&rim.points).dot(direction) < 0.0;
    let [first, second] = [(0, false), (1, true)].map(|(k, back)| Step {
        curve: rims[k].index,
        reversed: reversed(rims[k]) != back,
    });
    let ends = |step: &Step, rim: &Curve| {
        rim.ends
            .map(|[a, b]| if step.reversed { [b, a] } else { [a, b] })
    };
    let [low, high] = [ends(&first, rims[0]), ends(&second, rims[1])];
    joined([(first, low), (second, high)], edges)
}

/// Points of a chain as seen along a direction.
pub(super) fn profile(points: &[Vector3<f64>], direction: &Vector3<f64>) -> Vec<Vector3<f64>> {
    let flat = |point: &Vector3<f64>| point - direction * direction.dot(point);
    points.iter().map(flat).collect()
}

/// Into which direction a wall goes from one of its curves: toward the other rim, or along a rim from
/// a straight curve at its end.
pub(super) fn inward_of_wall(
    curves: &Curves,
    face: &Face,
    curve: &Curve,
    direction: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let points = |step: &Step| Some(&curves.find(step.curve)?.points);
    let [one, other] = face.rims()?;
    let opposite = match curve.index {
        index if index == one.curve => other,
        index if index == other.curve => one,
        _ => {
            let rim = points(&one)?;
            let last = rim.len() - 1;
            let begins = curve.points.contains(&rim[0]);
            let [from, to] = if begins { [0, 1] } else { [last, last - 1] };
            return (rim[to] - rim[from]).try_normalize(0.0);
        }
    };
    let toward = centroid(points(&opposite)?) - centroid(&curve.points);
    Some(direction * direction.dot(&toward).signum())
}

/// Appends the triangles between two rims that run beside each other, the second one backwards.
/// The first and the last point of closed ones are the same.
pub(super) fn strip(
    [one, other]: [&[usize]; 2],
    points: &[Vector3<f64>],
    direction: &Vector3<f64>,
    triangles: &mut Vec<[usize; 3]>,
) {
    let mut back: Vec<usize> = other.iter().rev().copied().collect();
    let apart = |a: usize, b: usize| {
        let between = points[b] - points[a];
        (between - direction * direction.dot(&between)).norm_squared()
    };
    if back.first() == back.last() {
        back.pop();
        let nearest = (0..back.len())
            .min_by(|j, k| apart(one[0], back[*j]).total_cmp(&apart(one[0], back[*k])));
        back.rotate_left(nearest.unwrap_or(0));
        back.push(back[0]);
    }
    let (mut i, mut j) = (0, 0);
    while i + 1 < one.len() || j + 1 < back.len() {
        let at_end = [i + 1 == one.len(), j + 1 == back.len()];
        let first = || apart(one[i + 1], back[j]) <= apart(back[j + 1], one[i]);
        if at_end[1] || (!at_end[0] && first()) {
            triangles.push([one[i], one[i + 1], back[j]]);
            i += 1;
        } else {
            triangles.push([one[i], back[j + 1], back[j]]);
            j += 1;
        }
    }
}

/// A wall where it lies in space.
pub(super) struct Wall {
    direction: Vector3<f64>,
    rims: [Vec<Vector3<f64>>; 2],
    profile: Vec<Vector3<f64>>,
    triangles: Vec<[Vector3<f64>; 3]>,
}

impl Wall {
    /// Between two rims, the second one backwards.
    pub fn new(rims: [Vec<Vector3<f64>>; 2], direction: Vector3<f64>) -> Self {
        let points = rims.concat();
        let count = rims[0].len();
        let mut places: [Vec<usize>; 2] = [(0..count).collect(), (count..points.len()).collect()];
        for (rim, places) in rims.iter().zip(&mut places) {
            if let (true, [first, .., last]) = (rim.first() == rim.last(), &mut places[..]) {
                *last = *first;
            }
        }
        let mut triangles = Vec::new();
        strip(
            [&places[0], &places[1]],
            &points,
            &direction,
            &mut triangles,
        );
        Self {
            profile: profile(&rims[0], &direction),
            triangles: triangles
                .iter()
                .map(|corners| corners.map(|k| points[k]))
                .collect(),
            rims,
            direction,
        }
    }

    /// Where a ray hits it, by its parameter.
    pub fn hits(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Vec<f64> {
        let hits = (self.triangles.iter()).filter_map(|corners| hit(corners, origin, direction));
        hits.map(|(t, _)| t).collect()
    }

    /// So many straight lines from one rim to the other.
    pub fn rulings(&self, count: usize) -> Vec<[Vector3<f64>; 2]> {
        let shares = (0..count).map(|k| (k as f64 + 0.5) / count as f64);
        let starts = shares.map(|share| point_along(&self.rims[0], share));
        starts
            .map(|start| [start, opposite(&start, &self.rims[1], &self.direction)])
            .collect()
    }

    /// Distance from the surface, which goes on beyond its rims.
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        let flat = profile(std::slice::from_ref(point), &self.direction);
        distance_to_chain(&self.profile, &flat[0])
    }

    /// Whether a point lies over or under the wall, at most `distance` away.
    pub fn is_near(&self, point: &Vector3<f64>, distance: f64) -> bool {
        let heights = || {
            self.rims
                .iter()
                .flatten()
                .map(|point| self.direction.dot(point))
        };
        let (low, high) = (
            heights().fold(f64::MAX, f64::min),
            heights().fold(f64::MIN, f64::max),
        );
        (low..=high).contains(&self.direction.dot(point)) && self.distance(point) <= distance
    }
}

/// Where a ray hits a triangle, by its parameter, and how far along the sides from the first corner
/// to the others that is (Möller and Trumbore).
pub(super) fn hit(
    [a, b, c]: &[Vector3<f64>; 3],
    origin: &Vector3<f64>,
    direction: &Vector3<f64>,
) -> Option<(f64, [f64; 2])> {
    let (u, v, offset) = (b - a, c - a, origin - a);
    let (across, along) = (direction.cross(&v), offset.cross(&u));
    let scale = 1.0 / u.dot(&across);
    let [x, y] = [offset.dot(&across) * scale, direction.dot(&along) * scale];
    (x >= 0.0 && y >= 0.0 && x + y <= 1.0).then(|| (v.dot(&along) * scale, [x, y]))
}

/// The point of a rim in this direction from a point of the other one.
pub(super) fn opposite(
    start: &Vector3<f64>,
    rim: &[Vector3<f64>],
    direction: &Vector3<f64>,
) -> Vector3<f64> {
    let beside = |offset: Vector3<f64>| offset - direction * direction.dot(&offset);
    let of_piece = |ends: &[Vector3<f64>]| {
        let (along, offset) = (beside(ends[1] - ends[0]), beside(start - ends[0]));
        let share = (along.dot(&offset) / along.norm_squared()).clamp(0.0, 1.0);
        let at = ends[0] + (ends[1] - ends[0]) * share;
        (
            beside(start - at).norm_squared(),
            direction.dot(&(at - start)),
        )
    };
    let places = rim.windows(2).map(of_piece);
    let nearest = places.min_by(|a, b| a.0.total_cmp(&b.0));
    start + direction * nearest.map_or(0.0, |(_, up)| up)
}

/// Of the area that a flat chain encloses with the line between its ends: however it is cut askew
/// from a wall, it is in one place along that.
fn centroid(points: &[Vector3<f64>]) -> Vector3<f64> {
    let whole = area_vector(points);
    let weighted = points.windows(2).map(|ends| {
        let [a, b] = [ends[0] - points[0], ends[1] - points[0]];
        (a + b) * (a.cross(&b).dot(&whole) / 3.0)
    });
    points[0] + weighted.sum::<Vector3<f64>>() / whole.norm_squared()
}

/// Twice the area that a chain encloses with the line between its ends, along its normal.
fn area_vector(points: &[Vector3<f64>]) -> Vector3<f64> {
    let pairs = points.windows(2);
    pairs
        .map(|ends| (ends[0] - points[0]).cross(&(ends[1] - points[0])))
        .sum()
}
