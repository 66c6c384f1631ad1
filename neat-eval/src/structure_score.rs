//! HSS, the hybrid structure score of building wireframes.
//!
//! Source: S23DR challenge 2025; `hoho2025/metric_helper.py` of s23dr/hoho2025.
//! The harmonic mean of the F1 score of vertices, paired one to one with the
//! smallest sum of distances and right up to 0.5 m, and of the volume that the
//! edges of both have in common by the volume of either (IoU), where every edge is
//! a solid of radius 0.5 m.
//!
//! The published solids are prisms with six sides, sheared where an edge is
//! parallel to no axis: only one of the two cross axes is made perpendicular to
//! the edge. Their volume shrinks by 1 - c², with c the cosine between the edge
//! and the other cross axis. They are taken as published. The published code
//! intersects meshes; here volumes are sampled, with a seed, to about a thousandth.

use crate::EvalError;
use crate::abc_nef::harmonic_mean;
use crate::table::Table;
use nalgebra::{Matrix3, Vector3};
use neat_core::{LineSegment3, Wireframe3d};
use neat_wireframe::metrics::{MetricsError, junction_distances};
use neat_wireframe::validity::check_wireframe;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The constants.
#[derive(Clone, Debug, PartialEq)]
pub struct StructureScore {
    /// Vertices agree that are this near or nearer, in metres.
    pub vertex_threshold: f64,
    /// Radius of the solids around edges, in metres.
    pub edge_radius: f64,
    /// Sampled points per wireframe.
    pub samples: usize,
    /// Seed of these.
    pub seed: u64,
}

impl Default for StructureScore {
    fn default() -> Self {
        Self {
            vertex_threshold: 0.5,
            edge_radius: 0.5,
            samples: 200_000,
            seed: 0,
        }
    }
}

/// HSS and its two parts, all from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StructureScores {
    /// Harmonic mean of the other two.
    pub hss: f64,
    /// F1 score of the vertices.
    pub vertex_f1: f64,
    /// Intersection over union of the edges' solids.
    pub edge_iou: f64,
}

impl StructureScores {
    pub(crate) fn table(&self) -> Table {
        let values = [
            ("HSS", self.hss),
            ("F1 of vertices", self.vertex_f1),
            ("IoU of edges", self.edge_iou),
        ];
        let values = values.map(|(name, value)| (name, format!("{value:.4}")));
        Table::of_values("Structure, higher is better", ["score", "value"], values)
    }
}

impl StructureScore {
    /// Measures `predicted` against `truth`, in metres. An empty side scores 0.
    ///
    /// # Errors
    /// If a wireframe is not valid.
    pub fn evaluate(
        &self,
        predicted: &Wireframe3d,
        truth: &Wireframe3d,
    ) -> Result<StructureScores, EvalError> {
        check_wireframe(&predicted.junctions, &predicted.edges).map_err(MetricsError::Predicted)?;
        check_wireframe(&truth.junctions, &truth.edges).map_err(MetricsError::Truth)?;
        let distances = junction_distances(&predicted.junctions, &truth.junctions)?;
        let pairs = distances.assign().map_err(MetricsError::from)?;
        let is_right = |distance: f64| distance <= self.vertex_threshold;
        let matched = pairs.iter().filter(|pair| is_right(pair.distance)).count();
        // 2PR / (P + R) with P and R of one number of pairs.
        let all = predicted.junctions.len() + truth.junctions.len();
        let vertex_f1 = 2.0 * matched as f64 / all.max(1) as f64;
        let edge_iou = self.edge_iou(predicted, truth);
        Ok(StructureScores {
            hss: harmonic_mean(vertex_f1, edge_iou),
            vertex_f1,
            edge_iou,
        })
    }

    fn edge_iou(&self, predicted: &Wireframe3d, truth: &Wireframe3d) -> f64 {
        let solids = |wireframe: &Wireframe3d| -> Vec<EdgePrism> {
            let segments = wireframe.segments();
            let prism = |segment| EdgePrism::new(segment, self.edge_radius);
            segments.iter().filter_map(prism).collect()
        };
        let (predicted, truth) = (solids(predicted), solids(truth));
        // The same random numbers for both: equal wireframes have equal volumes.
        let of_predicted = self.volumes(&predicted, &truth);
        let of_truth = self.volumes(&truth, &predicted);
        // Both sides estimate the intersection.
        let intersection = (of_predicted.shared + of_truth.shared) / 2.0;
        let union = of_predicted.whole + of_truth.whole - intersection;
        // Coordinates near the largest numbers have no volume that is one.
        if union > 0.0 && union.is_finite() {
            (intersection / union).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// Volume of the union of `solids`, and of its part in `others` (Karp and
    /// Luby 1985): a point that lies in n solids counts for one nth.
    fn volumes(&self, solids: &[EdgePrism], others: &[EdgePrism]) -> Volumes {
        let total: f64 = solids.iter().map(|solid| solid.volume).sum();
        let parts: Vec<Volumes> = solids
            .par_iter()
            .enumerate()
            .map(|(index, solid)| {
                let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
                rng.set_stream(index as u64);
                let share = solid.volume / total;
                let samples = (self.samples as f64 * share).ceil().max(1.0) as usize;
                let mut part = Volumes::default();
                for _ in 0..samples {
                    let point = solid.random_point(&mut rng);
                    // The point lies in its own solid, whatever rounding says.
                    let covering = 1 + solids
                        .iter()
                        .enumerate()
                        .filter(|(other, solid)| *other != index && solid.contains(&point))
                        .count();
                    let volume = solid.volume / (samples * covering) as f64;
                    part.whole += volume;
                    if others.iter().any(|other| other.contains(&point)) {
                        part.shared += volume;
                    }
                }
                part
            })
            .collect();
        parts.iter().fold(Volumes::default(), |sum, part| Volumes {
            whole: sum.whole + part.whole,
            shared: sum.shared + part.shared,
        })
    }
}

#[derive(Clone, Copy, Default)]
struct Volumes {
    whole: f64,
    shared: f64,
}

/// The published solid around an edge: a prism over a regular hexagon, perhaps
/// sheared.
struct EdgePrism {
    center: Vector3<f64>,
    /// Columns: the two cross axes and the unit direction of the edge.
    axes: Matrix3<f64>,
    inverse: Matrix3<f64>,
    half_length: f64,
    radius: f64,
    volume: f64,
}

/// Edges that are shorter have no solid, as published.
const MIN_LENGTH: f64 = 1e-6;

impl EdgePrism {
    /// `None` for an edge without length, or one whose solid has no volume.
    fn new(segment: &LineSegment3, radius: f64) -> Option<Self> {
        let length = segment.length();
        if length < MIN_LENGTH {
            return None;
        }
        let direction = (segment.end - segment.start) / length;
        let (x, y) = (Vector3::x(), Vector3::y());
        let axes = if direction.x.abs() < direction.y.abs() {
            Matrix3::from_columns(&[x, -x.cross(&direction), direction])
        } else {
            Matrix3::from_columns(&[y.cross(&direction), y, direction])
        };
        let hexagon = 1.5 * 3.0_f64.sqrt() * radius * radius;
        Some(Self {
            center: segment.point_at(0.5),
            axes,
            inverse: axes.try_inverse()?,
            half_length: length / 2.0,
            radius,
            volume: hexagon * length * axes.determinant().abs(),
        })
    }

    fn contains(&self, point: &Vector3<f64>) -> bool {
        let local = self.inverse * (point - self.center);
        local.z.abs() <= self.half_length && is_in_hexagon(local.x, local.y, self.radius)
    }

    fn random_point(&self, rng: &mut ChaCha8Rng) -> Vector3<f64> {
        let mut uniform = |half: f64| (2.0 * rng.random::<f64>() - 1.0) * half;
        let z = uniform(self.half_length);
        loop {
            let (x, y) = (uniform(self.radius), uniform(self.radius));
            if is_in_hexagon(x, y, self.radius) {
                return self.center + self.axes * Vector3::new(x, y, z);
            }
        }
    }
}

/// The regular hexagon with corners at `radius` from its centre, one of them on
/// the x axis.
fn is_in_hexagon(x: f64, y: f64, radius: f64) -> bool {
    let sqrt_3 = 3.0_f64.sqrt();
    let (x, y) = (x.abs(), y.abs());
    2.0 * y <= sqrt_3 * radius && sqrt_3 * x + y <= sqrt_3 * radius
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge(start: [f64; 3], end: [f64; 3]) -> Wireframe3d {
        Wireframe3d {
            junctions: vec![start.into(), end.into()],
            edges: vec![[0, 1]],
        }
    }

    fn scores(predicted: &Wireframe3d, truth: &Wireframe3d) -> StructureScores {
        StructureScore::default()
            .evaluate(predicted, truth)
            .unwrap()
    }

    #[test]
    fn a_wireframe_is_perfect_against_itself() {
        let truth = Wireframe3d {
            junctions: [[0.0, 0.0, 0.0], [4.0, 1.0, 0.0], [4.0, 5.0, 2.0]]
                .map(Vector3::from)
                .to_vec(),
            edges: vec![[0, 1], [1, 2], [2, 0]],
        };
        let perfect = scores(&truth, &truth);
        assert_eq!(perfect.vertex_f1, 1.0);
        assert!((perfect.edge_iou - 1.0).abs() < 1e-12);
        assert!((perfect.hss - 1.0).abs() < 1e-12);
    }

    /// Along an axis the solid is a whole hexagonal prism: shifting it by half of
    /// its length leaves a third in common.
    #[test]
    fn a_shifted_edge_by_hand() {
        let truth = edge([0.0; 3], [4.0, 0.0, 0.0]);
        let shifted = edge([2.0, 0.0, 0.0], [6.0, 0.0, 0.0]);
        let found = scores(&shifted, &truth);
        // Ends: (2, 6) on (0, 4), all 2 m away.
        assert_eq!(found.vertex_f1, 0.0);
        assert_eq!(found.hss, 0.0);
        assert!((found.edge_iou - 1.0 / 3.0).abs() < 3e-3, "{found:?}");

        let longer = edge([0.0; 3], [4.5, 0.0, 0.0]);
        let found = scores(&longer, &truth);
        assert_eq!(found.vertex_f1, 1.0, "0.5 m is near enough");
        assert!((found.edge_iou - 4.0 / 4.5).abs() < 3e-3);
        let expected = 2.0 * (4.0 / 4.5) / (1.0 + 4.0 / 4.5);
        assert!((found.hss - expected).abs() < 3e-3);
    }

    #[test]
    fn volumes_are_those_of_the_published_meshes() {
        // From trimesh, for an edge of twice the direction and a radius of 0.5.
        for (direction, volume) in [
            ([0.0, 0.0, 1.0], 1.299_038_105_676_658),
            ([1.0, 1.0, 0.0], 0.918_558_653_543_691_7),
            ([1.0, 0.5, 0.3], 1.223_195_823_401_984_6),
            ([0.2, 1.0, 0.4], 1.375_590_782_173_245),
            ([1.0, 0.0, 1.0], 1.837_117_307_087_383_9),
        ] {
            let end = Vector3::from(direction) * 2.0;
            let prism = EdgePrism::new(&LineSegment3::new(Vector3::zeros(), end), 0.5).unwrap();
            assert!((prism.volume - volume).abs() < 1e-12, "{direction:?}");
        }
        // Two edges that meet at a right angle, also from trimesh.
        let angle = Wireframe3d {
            junctions: [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]
                .map(Vector3::from)
                .to_vec(),
            edges: vec![[0, 1], [0, 2]],
        };
        let segments = angle.segments();
        let prisms: Vec<_> = segments
            .iter()
            .filter_map(|segment| EdgePrism::new(segment, 0.5))
            .collect();
        let volumes = StructureScore::default().volumes(&prisms, &[]);
        assert!((volumes.whole - 2.473_997_600_770_491).abs() < 5e-3);
    }

    #[test]
    fn nothing_scores_nothing_and_nan_is_refused() {
        let truth = edge([0.0; 3], [4.0, 0.0, 0.0]);
        for (a, b) in [
            (&Wireframe3d::default(), &truth),
            (&truth, &Wireframe3d::default()),
        ] {
            assert_eq!(scores(a, b).hss, 0.0);
        }
        let point = edge([1.0; 3], [1.0; 3]);
        assert_eq!(scores(&point, &truth).edge_iou, 0.0);
        let broken = edge([0.0; 3], [f64::NAN; 3]);
        assert!(StructureScore::default().evaluate(&broken, &truth).is_err());
    }
}
