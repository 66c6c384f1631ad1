//! The noise of the detected ends, estimated from what is left after adjustment.

use super::config::CovarianceConfig;
use crate::statistics::{SIGMA_BY_MEDIAN, upper_median};
use serde::{Deserialize, Serialize};

/// Standard deviations of detected ends in pixels.
///
/// Detectors find lines better than their ends, and where several segments of a
/// view share an end, it is a point of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectionNoise {
    /// Of each coordinate of an end that several segments share.
    pub vertex: f64,
    /// Of the end of one segment across it.
    pub across: f64,
    /// Of the end of one segment along it, where it shows a junction.
    pub along: f64,
}

/// Which of them a residual tells about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoiseKind {
    Vertex,
    Across,
    Along,
}

/// Fewer residuals of one kind tell nothing.
const MIN_RESIDUALS: usize = 20;

impl DetectionNoise {
    /// Before anything is known.
    pub(super) fn usual(config: &CovarianceConfig) -> Self {
        let sigma = config.usual_noise_in_pixels;
        Self {
            vertex: sigma,
            across: sigma,
            along: sigma,
        }
    }

    pub(super) fn of(&self, kind: NoiseKind) -> f64 {
        match kind {
            NoiseKind::Vertex => self.vertex,
            NoiseKind::Across => self.across,
            NoiseKind::Along => self.along,
        }
    }

    /// From residuals in pixels, of an adjustment with that many parameters.
    pub(super) fn estimate(
        residuals: &[(NoiseKind, f64)],
        parameters: usize,
        config: &CovarianceConfig,
    ) -> Self {
        /// Fewer observations than parameters are no reason for endless noise.
        const MAX_FACTOR: f64 = 4.0;
        let count = residuals.len() as f64;
        let freedom = (count - parameters as f64).max(count / MAX_FACTOR);
        // Adjustment takes up part of the noise.
        let factor = if freedom > 0.0 {
            (count / freedom).sqrt()
        } else {
            1.0
        };
        let of_kind = |kind: NoiseKind| {
            let of_kind = residuals.iter().filter(|(other, _)| *other == kind);
            let sigma = robust_sigma(of_kind.map(|(_, x)| x.abs()).collect(), config)?;
            Some((factor * sigma).max(config.min_noise_in_pixels))
        };
        let [vertex, across, along] =
            [NoiseKind::Vertex, NoiseKind::Across, NoiseKind::Along].map(of_kind);
        let usual = Self::usual(config).vertex;
        let fallback = vertex.or(across).or(along).unwrap_or(usual);
        Self {
            vertex: vertex.unwrap_or(fallback),
            across: across.unwrap_or(fallback),
            along: along.unwrap_or(fallback),
        }
    }
}

/// Root mean square of the magnitudes that a robust first guess takes for noise.
fn robust_sigma(mut magnitudes: Vec<f64>, config: &CovarianceConfig) -> Option<f64> {
    if magnitudes.len() < MIN_RESIDUALS {
        return None;
    }
    let median = upper_median(&mut magnitudes);
    let first_guess = (SIGMA_BY_MEDIAN * median).max(config.min_noise_in_pixels);
    let limit = config.max_standard_deviations * first_guess;
    // Sorted, so that the sum does not depend on the selection.
    magnitudes.retain(|x| *x <= limit);
    magnitudes.sort_by(f64::total_cmp);
    let sum: f64 = magnitudes.iter().map(|x| x * x).sum();
    Some((sum / magnitudes.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::Noise;

    /// Nearly normal with standard deviation 1: the sum of twelve uniform numbers.
    fn normal(noise: &mut Noise) -> f64 {
        (0..12).map(|_| noise.uniform()).sum::<f64>() * 0.5
    }

    #[test]
    fn errors_do_not_count_and_parameters_do() {
        let config = CovarianceConfig::default();
        let mut noise = Noise(3);
        let mut residuals: Vec<_> = (0..3000)
            .flat_map(|_| {
                [
                    (NoiseKind::Vertex, 0.4 * normal(&mut noise)),
                    (NoiseKind::Across, 0.2 * normal(&mut noise)),
                    (NoiseKind::Along, 1.0 * normal(&mut noise)),
                ]
            })
            .collect();
        residuals.extend((0..300).map(|_| (NoiseKind::Vertex, 3.0 + noise.uniform())));
        let found = DetectionNoise::estimate(&residuals, 0, &config);
        assert!((found.vertex / 0.4 - 1.0).abs() < 0.05, "{found:?}");
        assert!((found.across / 0.2 - 1.0).abs() < 0.05, "{found:?}");
        assert!((found.along / 1.0 - 1.0).abs() < 0.05, "{found:?}");
        let half = DetectionNoise::estimate(&residuals, residuals.len() / 2, &config);
        assert!((half.along / found.along - 2f64.sqrt()).abs() < 1e-3);
    }

    #[test]
    fn few_residuals_borrow_and_none_are_usual() {
        let config = CovarianceConfig::default();
        let usual = DetectionNoise::usual(&config);
        assert_eq!(DetectionNoise::estimate(&[], 7, &config), usual);
        let exact = [(NoiseKind::Across, 0.0); 50];
        let found = DetectionNoise::estimate(&exact, 0, &config);
        assert_eq!(found.across, config.min_noise_in_pixels);
        assert_eq!(found.vertex, found.across);
    }
}
