//! The weights of the calibration by edges of which it is known whether they exist: a logistic
//! regression of those that are more than chance (Fisher's scoring).

use nalgebra::{Matrix3, Vector3};
use neat_wireframe::confidence::ExistenceWitnesses;

/// An edge, and how much it counts.
#[derive(Clone, Copy)]
pub struct WeighedEdge {
    pub witnesses: ExistenceWitnesses,
    pub exists: bool,
    pub weight: f64,
}

impl WeighedEdge {
    fn row(&self) -> Vector3<f64> {
        Vector3::new(1.0, self.witnesses.precision, self.witnesses.whole_share)
    }

    /// The probability by some weights that it exists.
    pub fn probability(&self, weights: [f64; 3]) -> f64 {
        self.witnesses.by_counts * self.witnesses.if_more_than_chance(weights)
    }
}

const STEPS: usize = 30;
/// What keeps a weight that no edge tells of.
const RIDGE: f64 = 1e-6;

/// The log-odds of an edge at the reference, and what precision and the share of whole edges add;
/// `None` where the edges do not tell.
pub fn weights(edges: &[WeighedEdge]) -> Option<[f64; 3]> {
    let mut weights: Vector3<f64> = Vector3::zeros();
    for _ in 0..STEPS {
        let mut information = Matrix3::identity() * RIDGE;
        let mut gradient = -RIDGE * weights;
        for edge in edges {
            let given = edge.witnesses.if_more_than_chance(weights.into());
            let probability = edge.probability(weights.into());
            let exists = f64::from(u8::from(edge.exists));
            // By how much a weight changes the logarithm of the odds.
            let row = (1.0 - given) / (1.0 - probability) * edge.row();
            information += edge.weight * probability * (1.0 - probability) * row * row.transpose();
            gradient += edge.weight * (exists - probability) * row;
        }
        let step = information.cholesky()?.solve(&gradient);
        // Few edges ask for steps that lead nowhere.
        weights += step / step.amax().max(1.0);
    }
    weights
        .iter()
        .all(|x| x.is_finite())
        .then(|| weights.into())
}
