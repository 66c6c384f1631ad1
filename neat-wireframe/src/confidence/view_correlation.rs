//! How much neighbouring views repeat each other's errors.
//!
//! A detector is misled by the same shading, rounding and texture in views from
//! similar directions, and poses are wrong together. A hundred such views say less
//! than a hundred independent ones. The correlation of the residuals of one
//! junction in two views, by the angle between the views, is measured over the
//! whole scene; it makes the covariances larger by what statisticians of samples
//! call the design effect.
//!
//! Errors that all views share leave no residuals and cannot be measured so.

use nalgebra::{Matrix3, Vector3};

/// Views farther apart than this many bins are taken for independent.
const BINS: usize = 6;
const BIN_IN_DEGREES: f64 = 15.0;
/// At most so many views of a junction are compared with each other, so that time
/// stays linear.
const MAX_VIEWS: usize = 64;

/// What one view says about a junction.
#[derive(Clone, Debug)]
pub(super) struct JunctionView {
    /// Unit direction from the junction to the camera.
    pub toward_camera: Vector3<f64>,
    /// Residual in units of its standard deviation, as a vector in the world
    /// parallel to the image.
    pub residual: Vector3<f64>,
    /// Derivative of the prediction of the same by the junction.
    pub by_junction: Matrix3<f64>,
}

/// Correlation of residuals in two views by the angle between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ViewCorrelation {
    bins: [f64; BINS],
}

impl ViewCorrelation {
    /// From the views of all junctions and the junctions' covariances, as they were
    /// if views were independent.
    pub(super) fn estimate(views: &[Vec<JunctionView>], covariances: &[Matrix3<f64>]) -> Self {
        /// What adjustment took up depends on the correlation itself.
        const ROUNDS: usize = 3;
        let mut found = Self { bins: [0.0; BINS] };
        for _ in 0..ROUNDS {
            found = found.refined(views, covariances);
        }
        found
    }

    fn refined(&self, views: &[Vec<JunctionView>], covariances: &[Matrix3<f64>]) -> Self {
        let mut sums = [0.0; BINS];
        let mut counts = [0.0; BINS];
        for (views, covariance) in views.iter().zip(covariances) {
            let covariance = covariance * self.design_effect(views);
            for [a, b] in pairs(views) {
                if let Some(bin) = bin(a, b) {
                    // Adjustment takes this from the common errors.
                    let taken = (a.by_junction * covariance * b.by_junction.transpose()).trace();
                    // Two numbers in each view.
                    sums[bin] += 0.5 * (a.residual.dot(&b.residual) + taken);
                    counts[bin] += 1.0;
                }
            }
        }
        let mut bins = [0.0; BINS];
        for bin in 0..BINS {
            if counts[bin] > 0.0 {
                // What may be chance, by one standard error, does not count.
                let correlation = sums[bin] / counts[bin] - (2.0 * counts[bin]).sqrt().recip();
                bins[bin] = correlation.clamp(0.0, 1.0);
            }
        }
        Self { bins }
    }

    /// The factor by which correlation makes the variance of a junction larger, at
    /// least 1.
    pub(super) fn design_effect(&self, views: &[JunctionView]) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for [a, b] in pairs(views) {
            sum += bin(a, b).map_or(0.0, |bin| self.bins[bin]);
            count += 1.0;
        }
        if count > 0.0 {
            1.0 + (views.len() as f64 - 1.0) * sum / count
        } else {
            1.0
        }
    }
}

/// All pairs among at most [`MAX_VIEWS`] evenly chosen views.
fn pairs(views: &[JunctionView]) -> impl Iterator<Item = [&JunctionView; 2]> {
    let step = views.len().div_ceil(MAX_VIEWS).max(1);
    let chosen: Vec<&JunctionView> = views.iter().step_by(step).collect();
    (0..chosen.len()).flat_map(move |b| {
        let chosen = chosen.clone();
        (0..b).map(move |a| [chosen[a], chosen[b]])
    })
}

fn bin(a: &JunctionView, b: &JunctionView) -> Option<usize> {
    let cosine = a.toward_camera.dot(&b.toward_camera).clamp(-1.0, 1.0);
    let bin = (cosine.acos().to_degrees() / BIN_IN_DEGREES) as usize;
    (bin < BINS).then_some(bin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    /// Residuals of 30 views of 40 junctions within a cone; a share of their
    /// variance is common to all views of a junction.
    fn views(common: f64) -> Vec<Vec<JunctionView>> {
        let mut noise = Noise(11);
        // The variance of a uniform number in [-1, 1) is a third.
        let mut unit = |variance: f64| noise.vector() * (3.0 * variance).sqrt();
        (0..40)
            .map(|_| {
                let shared = unit(common);
                (0..30)
                    .map(|_| {
                        let mut residual = shared + unit(1.0 - common);
                        residual.z = 0.0;
                        JunctionView {
                            toward_camera: (Vector3::z() * 5.0 + unit(1.0)).normalize(),
                            residual,
                            by_junction: Matrix3::zeros(),
                        }
                    })
                    .collect()
            })
            .collect()
    }

    #[test]
    fn correlation_is_found_and_makes_many_views_worth_few() {
        let covariances = vec![Matrix3::zeros(); 40];
        let correlated = views(0.4);
        let found = ViewCorrelation::estimate(&correlated, &covariances);
        assert!((found.bins[0] - 0.4).abs() < 0.15, "{found:?}");
        let effect = found.design_effect(&correlated[0]);
        assert!((8.0..18.0).contains(&effect), "{effect}");
        assert_eq!(found.design_effect(&correlated[0][..1]), 1.0);

        let independent = views(0.0);
        let found = ViewCorrelation::estimate(&independent, &covariances);
        let effect = found.design_effect(&independent[0]);
        assert!((1.0..1.4).contains(&effect), "{effect}");
    }
}
