//! Soft constraints of the bundle adjustment that come from no image: directions
//! of edges, and planes and lines of junctions.

use crate::bundle_adjustment::BundleAdjustmentConfig;
use crate::normal_equations::NormalEquations;
use nalgebra::{Matrix3, Vector3};

/// Where a graph is pulled. Each counts like a residual in pixels, with the same
/// robust loss.
#[derive(Default)]
pub(crate) struct Pulls {
    pub directions: Vec<EdgeDirection>,
    pub junctions: Vec<JunctionPull>,
}

/// An edge that is expected to have a direction.
pub(crate) struct EdgeDirection {
    /// Indices of its junctions.
    pub junctions: [usize; 2],
    /// A unit vector.
    pub direction: Vector3<f64>,
    /// Factor of the part of the edge across the direction.
    pub weight: f64,
}

/// A junction that is expected in a plane or on a line.
pub(crate) struct JunctionPull {
    pub junction: usize,
    /// A point of the plane or line.
    pub anchor: Vector3<f64>,
    /// The projection on what is across the plane or line: symmetric, and its
    /// own square.
    pub across: Matrix3<f64>,
    /// Factor of the distance.
    pub weight: f64,
}

impl EdgeDirection {
    /// The projection on what is across the direction.
    fn across(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.direction * self.direction.transpose()
    }

    fn residual(&self, junctions: &[Vector3<f64>]) -> Vector3<f64> {
        let [a, b] = self.junctions.map(|junction| junctions[junction]);
        self.across() * (b - a)
    }
}

impl JunctionPull {
    fn residual(&self, junctions: &[Vector3<f64>]) -> Vector3<f64> {
        self.across * (junctions[self.junction] - self.anchor)
    }
}

impl Pulls {
    pub(crate) fn is_empty(&self) -> bool {
        self.directions.is_empty() && self.junctions.is_empty()
    }

    /// The robust cost of what is not kept.
    pub(crate) fn cost(&self, junctions: &[Vector3<f64>], config: &BundleAdjustmentConfig) -> f64 {
        let directions = self
            .directions
            .iter()
            .map(|pull| pull.weight * pull.residual(junctions).norm());
        let places = self
            .junctions
            .iter()
            .map(|pull| pull.weight * pull.residual(junctions).norm());
        directions
            .chain(places)
            .map(|residual| (residual / config.cauchy_scale_in_pixels).powi(2).ln_1p())
            .sum()
    }

    /// Adds the normal equations of the pulls.
    pub(crate) fn add_to(
        &self,
        equations: &mut NormalEquations,
        junctions: &[Vector3<f64>],
        config: &BundleAdjustmentConfig,
    ) {
        let robust = |weight: f64, residual: &Vector3<f64>| {
            let squared = weight * weight;
            let scale = config.cauchy_scale_in_pixels;
            squared / (1.0 + squared * residual.norm_squared() / (scale * scale))
        };
        for pull in &self.directions {
            let residual = pull.residual(junctions);
            let weight = robust(pull.weight, &residual);
            let [a, b] = pull.junctions;
            let block = weight * pull.across();
            equations.diagonal[a] += block;
            equations.diagonal[b] += block;
            equations.off_diagonal.push((pull.junctions, -block));
            equations.gradient[a] -= weight * residual;
            equations.gradient[b] += weight * residual;
        }
        for pull in &self.junctions {
            let residual = pull.residual(junctions);
            let weight = robust(pull.weight, &residual);
            equations.diagonal[pull.junction] += weight * pull.across;
            equations.gradient[pull.junction] += weight * residual;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    #[test]
    fn gradient_agrees_with_finite_differences() {
        let mut noise = Noise(3);
        let junctions: Vec<_> = (0..4).map(|_| noise.vector()).collect();
        let normal = Vector3::new(0.0, 0.6, 0.8);
        let pulls = Pulls {
            directions: vec![EdgeDirection {
                junctions: [2, 0],
                direction: Vector3::new(0.6, 0.0, 0.8),
                weight: 1.7,
            }],
            junctions: vec![JunctionPull {
                junction: 2,
                anchor: Vector3::new(0.1, 0.2, 0.3),
                across: normal * normal.transpose(),
                weight: 0.8,
            }],
        };
        let config = BundleAdjustmentConfig::default();
        let mut equations = NormalEquations::new(junctions.len());
        pulls.add_to(&mut equations, &junctions, &config);
        let step = 1e-6;
        for (junction, analytic) in equations.gradient.iter().enumerate() {
            for axis in 0..3 {
                let cost_at = |offset: f64| {
                    let mut moved = junctions.clone();
                    moved[junction][axis] += offset;
                    pulls.cost(&moved, &config)
                };
                let numeric = (cost_at(step) - cost_at(-step)) / (2.0 * step);
                assert!((numeric - 2.0 * analytic[axis]).abs() < 1e-8);
            }
        }
    }
}
