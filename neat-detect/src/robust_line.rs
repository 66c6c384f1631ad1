//! Straight lines through points of which some do not belong to them.

/// Rounds of reweighting.
const REWEIGHTINGS: usize = 4;
/// The smallest spread that the weights assume, in pixels.
const MIN_SPREAD: f64 = 0.05;
/// Where Tukey's biweight ends, in standard deviations.
const BIWEIGHT_CUTOFF: f64 = 4.685;
/// From the median absolute deviation to the standard deviation of a Gaussian.
pub(crate) const DEVIATION_FROM_MEDIAN: f64 = 1.4826;
/// A fit needs so many points.
pub(crate) const MIN_POINTS: usize = 4;

/// offset = `offset` + `slope` · position, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RobustLine {
    pub offset: f64,
    pub slope: f64,
    /// Robust standard deviation of the points from the line.
    pub spread: f64,
}

impl RobustLine {
    /// The line through (position, offset) points by least squares reweighted
    /// with Tukey's biweight. `None` where the points determine none.
    pub(crate) fn fit(points: &[[f64; 2]]) -> Option<Self> {
        if points.len() < MIN_POINTS {
            return None;
        }
        let mut line = Self {
            offset: median(points.iter().map(|point| point[1])),
            slope: 0.0,
            spread: 0.0,
        };
        for round in 0..=REWEIGHTINGS {
            line.spread =
                DEVIATION_FROM_MEDIAN * median(points.iter().map(|p| line.residual(p).abs()));
            // The first line may lie askew: its weights are generous.
            let generosity = if round == 0 { 2.0 } else { 1.0 };
            let cutoff = generosity * BIWEIGHT_CUTOFF * line.spread.max(MIN_SPREAD);
            let weights: Vec<f64> = (points.iter())
                .map(|point| {
                    (1.0 - (line.residual(point) / cutoff).powi(2))
                        .max(0.0)
                        .powi(2)
                })
                .collect();
            [line.offset, line.slope] = weighted_line(points, &weights)?;
        }
        Some(line)
    }

    fn residual(&self, [position, offset]: &[f64; 2]) -> f64 {
        offset - self.offset - self.slope * position
    }
}

/// Offset and slope by weighted least squares; `None` where the weight lies on
/// one place.
fn weighted_line(points: &[[f64; 2]], weights: &[f64]) -> Option<[f64; 2]> {
    let sum: f64 = weights.iter().sum();
    let mean = |axis: usize| {
        let terms = points
            .iter()
            .zip(weights)
            .map(|(point, weight)| weight * point[axis]);
        terms.sum::<f64>() / sum
    };
    let [position, offset] = [mean(0), mean(1)];
    let (mut variance, mut covariance) = (0.0, 0.0);
    for (point, weight) in points.iter().zip(weights) {
        let centered = point[0] - position;
        variance += weight * centered * centered;
        covariance += weight * centered * (point[1] - offset);
    }
    let slope = covariance / variance;
    slope
        .is_finite()
        .then_some([offset - slope * position, slope])
}

/// Height of the arc that fits the points best over `length`: how far its middle
/// lies from the chord of its ends. 0 where the points determine none.
pub(crate) fn sagitta(points: &[[f64; 2]], length: f64) -> f64 {
    let n = points.len() as f64;
    let mean = |value: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(value).sum::<f64>() / n;
    // Regress the offset on the part of the squared position that no line explains.
    let center = mean(&|p| p[0]);
    let variance = mean(&|p| (p[0] - center).powi(2));
    let skew = mean(&|p| (p[0] - center).powi(3)) / variance;
    let square = |p: &[f64; 2]| {
        let x = p[0] - center;
        x * x - variance - skew * x
    };
    let curvature = mean(&|p| square(p) * p[1]) / mean(&|p| square(p).powi(2));
    let height = curvature * length * length / 4.0;
    if height.is_finite() {
        height.abs()
    } else {
        0.0
    }
}

/// The upper median; 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_third_of_outliers_does_not_move_the_line() {
        let points: Vec<[f64; 2]> = (0..30)
            .map(|i| {
                let x = f64::from(i) - 14.5;
                [x, if i % 3 == 0 { 2.0 } else { 0.25 + 0.01 * x }]
            })
            .collect();
        let line = RobustLine::fit(&points).unwrap();
        assert!((line.offset - 0.25).abs() < 1e-6, "{line:?}");
        assert!((line.slope - 0.01).abs() < 1e-6, "{line:?}");
        assert_eq!(RobustLine::fit(&points[..MIN_POINTS - 1]), None);
        assert_eq!(RobustLine::fit(&[[1.0, 0.0]; 9]), None);
    }

    #[test]
    fn the_height_of_an_arc_is_found_on_any_slope() {
        // A parabola of height 0.8 over [-10, 10], on a slanted line.
        let points: Vec<[f64; 2]> = (-10..=10)
            .map(f64::from)
            .map(|x| [x, 0.8 * (1.0 - x * x / 100.0) + 0.05 * x + 3.0])
            .collect();
        assert!((sagitta(&points, 20.0) - 0.8).abs() < 1e-9);
        assert!(sagitta(&points.map_offsets(|x| 0.05 * x), 20.0) < 1e-9);
        assert_eq!(sagitta(&[], 20.0), 0.0);
    }

    trait MapOffsets {
        fn map_offsets(&self, f: impl Fn(f64) -> f64) -> Vec<[f64; 2]>;
    }

    impl MapOffsets for Vec<[f64; 2]> {
        fn map_offsets(&self, f: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
            self.iter().map(|p| [p[0], f(p[0])]).collect()
        }
    }
}
