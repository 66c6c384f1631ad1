//! The planes of a scene, each chosen by what it explains: edges and points of surfaces that lie
//! in it within their noise, wherever in the scene they are.
//!
//! A plane is worth, in nats, what is more likely with it than without. Of N ends of edges and
//! points a share π lies on it, at a distance d with the standard deviation σ along the normal,
//! and the others anywhere in the extent D of the scene:
//!
//! Σ ln(1 − π + π · D / (σ √2π) · exp(−d²/2σ²)),
//!
//! less what it takes to say where it is: three numbers to σ of D.

use super::curves::Curves;
use super::plane_fit::{CHI_SQUARE, PlaneFit};
use super::selection::SAME_PLANE;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

/// Planes are proposed by pairs among so many of the longest edges: of a building with 880 edges
/// twice as many find the same walls and roofs, and there are four times as many pairs to ask.
const PROPOSING: usize = 150;
/// Edges at a greater sine span a plane by their directions, others by what lies between them.
const MIN_SINE: f64 = 0.2;
/// An edge is the border of two faces at most.
const FACES_OF_EDGE: usize = 2;
/// What lies in a plane is asked anew so often.
const ROUNDS: usize = 3;

/// A measured point with its covariance.
pub(super) type Measured = (Vector3<f64>, Matrix3<f64>);

/// What lies in planes: the ends of an edge, or a point.
struct Item<'a> {
    measured: &'a [Measured],
    /// How many planes may have it.
    most: usize,
    /// The normals of those that do.
    taken_by: Vec<Vector3<f64>>,
}

impl Item<'_> {
    /// Whether a plane may have it beside those that do: an edge between two faces that go on as
    /// one plane is none of theirs.
    fn is_left_for(&self, normal: &Vector3<f64>) -> bool {
        self.taken_by.len() < self.most
            && (self.taken_by.iter()).all(|other| other.dot(normal).abs() < SAME_PLANE)
    }
}

/// The planes that explain more than they cost, the one that explains most first.
pub(super) fn explained_planes(curves: &Curves, points: &[Measured]) -> Vec<PlaneFit> {
    let edges = || curves.observed().filter(|curve| curve.is_straight());
    let mut items: Vec<Item> = edges()
        .map(|edge| Item {
            measured: &edge.measured,
            most: FACES_OF_EDGE,
            taken_by: Vec::new(),
        })
        .chain(points.chunks(1).map(|point| Item {
            measured: point,
            most: 1,
            taken_by: Vec::new(),
        }))
        .collect();
    let lines: Vec<&[Measured]> = edges().map(|edge| &edge.measured[..]).collect();
    let score = |items: &[Item], (normal, offset): (Vector3<f64>, f64)| {
        score(items, &normal, offset, curves.extent)
    };
    let proposals = proposals(&lines);
    let scored: Vec<Proposal> = (proposals.into_par_iter().enumerate())
        .map(|(place, plane)| Proposal {
            gain: score(&items, plane),
            place,
            plane,
        })
        .filter(|proposal| proposal.gain > 0.0)
        .collect();
    let mut queue = BinaryHeap::from(scored);
    let mut planes = Vec::new();
    while let Some(mut proposal) = queue.pop() {
        // What others have taken by now is explained already, so that gains fall: nearly always,
        // as the share on a plane grows when others take what does not lie on it.
        proposal.gain = score(&items, proposal.plane);
        if proposal.gain <= 0.0 {
            continue;
        }
        if queue.peek().is_some_and(|next| next.gain > proposal.gain) {
            queue.push(proposal);
            continue;
        }
        let Some(fit) = fitted(&items, proposal.plane, curves.extent) else {
            continue;
        };
        let Some(plane) = fit.solved() else { continue };
        let (normal, offset) = plane.plane();
        if score(&items, (normal, offset)) <= 0.0 {
            continue;
        }
        for item in items.iter_mut().filter(|item| item.is_left_for(&normal)) {
            if (item.measured.iter()).all(|(point, covariance)| plane.holds(point, covariance)) {
                item.taken_by.push(normal);
            }
        }
        planes.push(fit);
    }
    planes
}

/// A plane that may be one.
struct Proposal {
    gain: f64,
    place: usize,
    plane: (Vector3<f64>, f64),
}

impl Ord for Proposal {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let by_gain = self.gain.total_cmp(&other.gain);
        by_gain.then(other.place.cmp(&self.place))
    }
}

impl PartialOrd for Proposal {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Proposal {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Proposal {}

/// The planes through pairs of long edges that lie in one.
fn proposals(edges: &[&[Measured]]) -> Vec<(Vector3<f64>, f64)> {
    let along = |edge: &[Measured]| edge[1].0 - edge[0].0;
    let mut longest: Vec<&[Measured]> = edges.to_vec();
    longest.sort_by(|a, b| along(b).norm().total_cmp(&along(a).norm()));
    longest.truncate(PROPOSING);
    let mut planes = Vec::new();
    for (place, one) in longest.iter().enumerate() {
        for other in &longest[..place] {
            let (u, v) = (along(one).normalize(), along(other).normalize());
            let crossed = u.cross(&v);
            let normal = if crossed.norm() > MIN_SINE {
                crossed
            } else {
                let between = other[0].0 - one[0].0;
                let apart = u.cross(&between);
                if apart.norm() <= MIN_SINE * between.norm() {
                    continue;
                }
                apart
            };
            let normal = normal.normalize();
            let ends = || one.iter().chain(other.iter());
            let offset = ends().map(|(point, _)| normal.dot(point)).sum::<f64>() / 4.0;
            let near = |(point, covariance): &Measured| {
                (normal.dot(point) - offset).powi(2) <= CHI_SQUARE * variance(covariance, &normal)
            };
            if ends().all(near) {
                planes.push((normal, offset));
            }
        }
    }
    planes
}

fn variance(covariance: &Matrix3<f64>, normal: &Vector3<f64>) -> f64 {
    normal.dot(&(covariance * normal))
}

/// What a plane explains more than it costs, in nats.
fn score(items: &[Item], normal: &Vector3<f64>, offset: f64, extent: f64) -> f64 {
    let mut ratios = Vec::new();
    let (mut count, mut on_plane, mut spread) = (0.0, 0.0, 0.0);
    for item in items.iter().filter(|item| item.is_left_for(normal)) {
        let ends = item.measured.len() as f64;
        count += ends;
        let Some(squares) = squares(item.measured, normal, offset) else {
            continue;
        };
        on_plane += ends;
        // The ends of an edge lie on the plane together.
        let log_ratio = |(squared, variance): (f64, f64)| {
            0.5 * ((extent.powi(2) / (TAU * variance)).ln() - squared / variance)
        };
        ratios.push((ends, squares.iter().copied().map(log_ratio).sum::<f64>()));
        spread += (squares.iter())
            .map(|(_, variance)| 0.5 * (extent.powi(2) / variance).ln())
            .sum::<f64>();
    }
    if ratios.is_empty() {
        return 0.0;
    }
    // One more that does not lie on it, so that nothing is impossible.
    let share = on_plane / (count + 1.0);
    let explained: f64 = (ratios.iter())
        .map(|(ends, ratio)| ((1.0 - share).powf(*ends) + share * ratio.exp()).ln())
        .sum();
    explained + (count - on_plane) * (1.0 - share).ln() - 3.0 * spread / on_plane
}

/// Of each point the squared distance from a plane and its variance, if all lie in it.
fn squares(measured: &[Measured], normal: &Vector3<f64>, offset: f64) -> Option<Vec<(f64, f64)>> {
    let of_point = |(point, covariance): &Measured| {
        let squared = (normal.dot(point) - offset).powi(2);
        let variance = variance(covariance, normal);
        (squared <= CHI_SQUARE * variance).then_some((squared, variance))
    };
    measured.iter().map(of_point).collect()
}

/// The plane through what lies in it, beginning with one near it.
fn fitted(items: &[Item], (normal, offset): (Vector3<f64>, f64), extent: f64) -> Option<PlaneFit> {
    let open = || items.iter().filter(|item| item.is_left_for(&normal));
    let mut members: Vec<Measured> = open()
        .filter(|item| squares(item.measured, &normal, offset).is_some())
        .flat_map(|item| item.measured.iter().copied())
        .collect();
    for _ in 0..ROUNDS {
        let fit = PlaneFit::through(members.iter(), extent)?;
        let plane = fit.solved()?;
        members = open()
            .filter(|item| item.measured.iter().all(|(p, c)| plane.holds(p, c)))
            .flat_map(|item| item.measured.iter().copied())
            .collect();
    }
    PlaneFit::through(members.iter(), extent)
}

#[cfg(test)]
mod tests {
    use super::super::curves::MeasuredGraph;
    use super::*;
    use crate::test_scenes::Noise;
    use neat_core::Wireframe3d;

    /// A corner of two walls, x = 0 and y = 0, with a loose edge and points on them and around.
    #[test]
    fn two_walls_are_two_planes_among_what_lies_anywhere() {
        let junctions = [
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0],
            [1.0, 0.0, 1.0],
            [0.0, 1.0, 0.0],
            [0.0, 1.0, 1.0],
            [0.3, 0.4, 0.2],
            [0.8, 0.9, 0.7],
        ];
        let wireframe = Wireframe3d {
            junctions: junctions.map(Vector3::from).to_vec(),
            edges: vec![[0, 1], [0, 2], [1, 3], [0, 4], [1, 5], [6, 7]],
        };
        let curves = Curves::new(&MeasuredGraph::of(&wireframe));
        let mut noise = Noise(3);
        let sigma = 1e-3;
        let covariance = Matrix3::identity() * f64::powi(sigma, 2) + curves.junction_floor();
        let points: Vec<Measured> = (0..90)
            .map(|k| {
                let mut point = noise.vector().map(|x| 0.5 + 0.5 * x);
                // A third on either wall, with errors of variance σ².
                if k % 3 < 2 {
                    point[k % 3] = sigma * noise.vector().sum();
                }
                (point, covariance)
            })
            .collect();
        let planes = explained_planes(&curves, &points);
        let mut found: Vec<(Vector3<f64>, f64)> = (planes.iter())
            .map(|fit| fit.solved().unwrap().plane())
            .collect();
        found.sort_by(|a, b| b.0.x.abs().total_cmp(&a.0.x.abs()));
        assert_eq!(found.len(), 2, "{found:?}");
        for (axis, (normal, offset)) in found.into_iter().enumerate() {
            assert!(normal[axis].abs() > 1.0 - 1e-5 && offset.abs() < sigma);
        }
    }
}
