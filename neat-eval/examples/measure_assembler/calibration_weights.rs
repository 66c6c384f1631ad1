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
    pub fn probability(&self, weights: &[f64; 3]) -> f64 {
        self.witnesses.by_counts * self.if_more_than_chance(&Vector3::from(*weights))
    }

    fn if_more_than_chance(&self, weights: &Vector3<f64>) -> f64 {
        1.0 / (1.0 + (-self.row().dot(weights)).exp())
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
            let by_counts = edge.witnesses.by_counts;
            let given = edge.if_more_than_chance(&weights);
            let probability = by_counts * given;
            let exists = f64::from(u8::from(edge.exists));
            let change = by_counts * given * (1.0 - given) * edge.row();
            let weight = edge.weight / (probability * (1.0 - probability));
            information += weight * change * change.transpose();
            gradient += weight * (exists - probability) * change;
        }
        weights += information.cholesky()?.solve(&gradient);
    }
    weights
        .iter()
        .all(|x| x.is_finite())
        .then(|| weights.into())
}
