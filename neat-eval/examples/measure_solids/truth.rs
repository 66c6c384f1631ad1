//! What a scene's folder says of the solid: its wireframe with arcs, its faces and its volume.

use crate::Result;
use nalgebra::Vector3;
use neat_core::{CircularArc, Spline, Wireframe3d};
use neat_eval::{TrueFace, foreign};
use serde::Deserialize;
use std::fs;
use std::path::Path;

/// Points of a curve lie within so much of its arc; what does not is another curve.
const TOLERANCE: f64 = 1e-4;
/// Control points of splines along them.
const CONTROLS: usize = 24;

/// The truth of one scene, in the frame of its files.
pub struct Truth {
    pub wireframe: Wireframe3d,
    /// The curves that are arcs of circles.
    pub arcs: Vec<CircularArc>,
    /// The others.
    pub splines: Vec<Spline>,
    /// Empty where the truth has none.
    pub faces: Vec<TrueFace>,
    /// Of the mesh.
    pub volume: Option<f64>,
}

impl Truth {
    pub fn read(dir: &Path) -> Result<Self> {
        let path = dir.join("gt_wireframe.json");
        let truth = foreign::read_truth(&path)?;
        let mut curves: Vec<Vec<Vector3<f64>>> =
            truth.curves.into_iter().map(|curve| curve.points).collect();
        // The toy has them beside its wireframe.
        let beside = dir.join("gt_curves.json");
        if beside.exists() {
            #[derive(Deserialize)]
            struct Curve {
                points: Vec<Vector3<f64>>,
            }
            let beside: Vec<Curve> = serde_json::from_slice(&fs::read(beside)?)?;
            curves.extend(beside.into_iter().map(|curve| curve.points));
        }
        let curves = joined(curves);
        let (mut arcs, mut splines) = (Vec::new(), Vec::new());
        for points in &curves {
            match arc_of(points) {
                Some(arc) => arcs.push(arc),
                None => splines.extend(spline_of(points)),
            }
        }
        // Other meshes are in frames of their own.
        let mesh = dir.join("mesh.obj");
        Ok(Self {
            wireframe: truth.wireframe,
            arcs,
            splines,
            faces: TrueFace::read(&path)?,
            volume: mesh.exists().then(|| mesh_volume(&mesh)).transpose()?,
        })
    }
}

/// Chains that end where one other begins become one: CAD kernels cut circles at seams.
fn joined(mut curves: Vec<Vec<Vector3<f64>>>) -> Vec<Vec<Vector3<f64>>> {
    let near = |a: &Vector3<f64>, b: &Vector3<f64>| (a - b).norm() < TOLERANCE;
    let mut k = 0;
    while k < curves.len() {
        let (first, last) = (curves[k][0], curves[k][curves[k].len() - 1]);
        let goes_on = |other: &Vec<Vector3<f64>>| {
            let ends = [other[0], other[other.len() - 1]];
            ends.iter()
                .filter(|end| near(end, &first) || near(end, &last))
                .count()
                == 2
        };
        let open = !near(&first, &last);
        match (k + 1..curves.len()).find(|other| open && goes_on(&curves[*other])) {
            Some(other) => {
                let mut rest = curves.remove(other);
                if !near(&rest[0], &last) {
                    rest.reverse();
                }
                curves[k].extend(rest.into_iter().skip(1));
            }
            None => k += 1,
        }
    }
    curves
}

/// The arc that a chain of points follows, if it is one.
fn arc_of(points: &[Vector3<f64>]) -> Option<CircularArc> {
    let count = points.len();
    let [first, last] = [points.first()?, points.last()?];
    let closed = (first - last).norm() < TOLERANCE;
    let third = if closed { 2 * count / 3 } else { count - 1 };
    let middle = if closed { count / 3 } else { count / 2 };
    let mut arc = CircularArc::through([*first, points[middle], points[third]])?;
    if closed {
        arc.angles[1] = arc.angles[0] + std::f64::consts::TAU;
    }
    let on_arc = |point: &Vector3<f64>| arc.distance_to_circle(point) < TOLERANCE;
    points.iter().all(on_arc).then_some(arc)
}

/// A spline along a chain of points.
fn spline_of(points: &[Vector3<f64>]) -> Option<Spline> {
    let closed = (points.first()? - points.last()?).norm() < TOLERANCE;
    let mut lengths = vec![0.0];
    for ends in points.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + (ends[1] - ends[0]).norm());
    }
    let at = |share: f64| {
        let length = share * lengths[lengths.len() - 1];
        let next = lengths
            .partition_point(|l| *l < length)
            .clamp(1, points.len() - 1);
        let part = (length - lengths[next - 1]) / (lengths[next] - lengths[next - 1]);
        points[next - 1] + (points[next] - points[next - 1]) * part
    };
    Spline::nearest_to(at, CONTROLS, closed)
}

/// The volume that the triangles of a Wavefront OBJ enclose.
fn mesh_volume(path: &Path) -> Result<f64> {
    let text = fs::read_to_string(path)?;
    let (mut vertices, mut six_fold) = (Vec::new(), 0.0);
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["v", x, y, z] => {
                vertices.push(Vector3::new(x.parse()?, y.parse()?, z.parse::<f64>()?))
            }
            ["f", a, b, c] => {
                let vertex = |word: &str| -> Result<Vector3<f64>> {
                    let index: usize = word.split('/').next().unwrap_or(word).parse()?;
                    vertices
                        .get(index.wrapping_sub(1))
                        .copied()
                        .ok_or_else(|| format!("{}: no vertex {index}", path.display()).into())
                };
                six_fold += vertex(a)?.dot(&vertex(b)?.cross(&vertex(c)?));
            }
            _ => {}
        }
    }
    Ok(six_fold.abs() / 6.0)
}
