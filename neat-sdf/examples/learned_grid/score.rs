//! How well a trained field knows its shape.

use super::field::Field;
use super::fit::{in_unit_ball, surface_point};
use super::shape::{Prism, Vector, dot};
use neat_tensor::random::{Purpose, standard_normal, stream};
use rand::RngExt;

/// Points of each kind.
const POINTS: usize = 4000;
/// Standard deviation of points near edges and junctions, along each axis.
const NEAR: f64 = 0.01;
/// How far from the true surface the found one is looked for.
const REACH: f64 = 0.1;
/// Distances asked for on the way.
const STATIONS: usize = 41;

/// Errors of a field; lengths relative to the radius of the ball.
#[derive(Clone, Copy, Debug, Default)]
pub struct Score {
    /// Mean error of the distance near edges.
    pub edges: f64,
    /// … near junctions.
    pub junctions: f64,
    /// Median angle between the gradient and the true normal near edges, in degrees.
    pub normals: f64,
    /// Mean of `||∇f| − 1|` near the surface.
    pub eikonal: f64,
    /// Mean distance from points of the surface to the zero set along the normal;
    /// `REACH` where there is none so near.
    pub surface: f64,
    /// Share of points of the ball, further than 0.02 from the surface, whose
    /// distance has the wrong sign.
    pub wrong_side: f64,
}

impl Score {
    /// Scores `parameters` of `field` against `shape`.
    pub fn new(field: &mut dyn Field, parameters: &[f32], shape: &Prism, seed: u64) -> Self {
        // Not the points of any training step.
        let mut rng = stream(seed, Purpose::Eikonal, 0);
        let edges = shape.edges();
        let mut near_edges = Vec::new();
        let mut near_junctions = Vec::new();
        for i in 0..POINTS {
            let [a, b] = edges[i % edges.len()];
            let t: f64 = rng.random();
            let mut near = |p: Vector| p.map(|x| x + NEAR * standard_normal(&mut rng));
            near_edges.push(near(std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))));
            near_junctions.push(near(a));
        }
        let mut mean_error = |points: &[Vector]| {
            let found = field.distances(parameters, &flat(points));
            mean(
                points
                    .iter()
                    .zip(found)
                    .map(|(p, found)| (f64::from(found) - shape.distance(*p).0).abs()),
            )
        };
        let (edges, junctions) = (mean_error(&near_edges), mean_error(&near_junctions));

        let gradients = field.forward(parameters, &flat(&near_edges)).gradient;
        let mut angles: Vec<f64> = near_edges
            .iter()
            .zip(gradients)
            .map(|(point, gradient)| angle(shape.distance(*point).1, gradient.map(f64::from)))
            .collect();
        angles.sort_by(f64::total_cmp);

        let feet: Vec<_> = (0..POINTS)
            .map(|_| surface_point(shape, &mut rng))
            .collect();
        let on_surface: Vec<Vector> = feet.iter().map(|(foot, _)| *foot).collect();
        let gradients = field.forward(parameters, &flat(&on_surface)).gradient;
        let lengths = gradients.iter().map(|g| {
            let g = g.map(f64::from);
            (dot(g, g).sqrt() - 1.0).abs()
        });

        let anywhere: Vec<Vector> = (0..POINTS).map(|_| in_unit_ball(&mut rng)).collect();
        let found = field.distances(parameters, &flat(&anywhere));
        let clear = anywhere.iter().zip(found).filter_map(|(p, found)| {
            let distance = shape.distance(*p).0;
            (distance.abs() > 0.02).then_some(f64::from(found) * distance < 0.0)
        });
        Self {
            edges,
            junctions,
            normals: angles[angles.len() / 2],
            eikonal: mean(lengths),
            surface: surface_error(field, parameters, &feet),
            wrong_side: mean(clear.map(f64::from)),
        }
    }
}

/// Mean distance from `feet` to the zero set, along the normal to both sides.
fn surface_error(field: &mut dyn Field, parameters: &[f32], feet: &[(Vector, Vector)]) -> f64 {
    let offset = |i: usize| REACH * (2.0 * i as f64 / (STATIONS - 1) as f64 - 1.0);
    let stations: Vec<Vector> = feet
        .iter()
        .flat_map(|(foot, normal)| {
            (0..STATIONS).map(move |i| std::array::from_fn(|k| foot[k] + offset(i) * normal[k]))
        })
        .collect();
    let found = field.distances(parameters, &flat(&stations));
    mean(found.chunks_exact(STATIONS).map(|values| {
        values
            .windows(2)
            .enumerate()
            .filter(|(_, pair)| (pair[0] < 0.0) != (pair[1] < 0.0))
            .map(|(i, pair)| {
                let t = f64::from(pair[0]) / f64::from(pair[0] - pair[1]);
                (offset(i) + t * (offset(i + 1) - offset(i))).abs()
            })
            .fold(REACH, f64::min)
    }))
}

fn flat(points: &[Vector]) -> Vec<f32> {
    points.as_flattened().iter().map(|x| *x as f32).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, n), x| (sum + x, n + 1));
    sum / count.max(1) as f64
}

/// The angle between a unit vector and a vector, in degrees.
fn angle(unit: Vector, other: Vector) -> f64 {
    let cosine = dot(unit, other) / dot(other, other).sqrt().max(1e-12);
    cosine.clamp(-1.0, 1.0).acos().to_degrees()
}
