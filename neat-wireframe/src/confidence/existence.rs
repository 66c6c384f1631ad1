//! Probability that an edge is more than chance.
//!
//! Of the n views that ought to show an edge, k do. Views of a true edge show it
//! with probability p₁, the detection rate of the scene; views of no edge show
//! one by coincidence with probability p₀, which is measured with decoys: random
//! lines of the same lengths from the same junctions. What views say about an edge
//! is correlated (neighbours see the same occlusion, the same texture), so both
//! counts follow beta-binomial distributions with mean p and pairwise correlation
//! ρ of the views. With a common ρ the likelihood ratio grows with every view that
//! shows the edge, and more slowly than for independent views. Edges that the
//! surface hides from nearly all views would escape the test; for them n has a
//! least value.
//!
//! p₁, ρ and the share π of true edges come from the edges themselves by
//! expectation maximisation, with weak priors that decide where there are few.

use super::config::ExistenceConfig;

/// How many of the views that ought to show an edge do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ViewCount {
    /// Views that show the edge.
    pub showing: usize,
    /// Views that ought to, including these.
    pub expected: usize,
}

impl ViewCount {
    fn at_least(self, expected: usize) -> Self {
        Self {
            expected: self.expected.max(expected),
            ..self
        }
    }
}

/// The two distributions of counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ExistenceModel {
    /// Share of true edges.
    prior: f64,
    /// Share of views that show a true edge.
    detection_rate: f64,
    /// Share of views that show no edge by coincidence.
    coincidence_rate: f64,
    /// Of what two views say about one edge.
    view_correlation: f64,
    /// An edge is expected in at least so many views.
    least_expected: usize,
}

/// No model is surer than that.
const MIN_PROBABILITY: f64 = 1e-3;
/// The prior of the detection rate counts as much as so many views.
const DETECTION_RATE_WEIGHT: f64 = 10.0;
const ITERATIONS: usize = 50;

impl ExistenceModel {
    /// From the counts of a wireframe's edges and of decoys.
    ///
    /// Every edge counts as expected in at least `least_expected` views.
    pub(super) fn fit(
        edges: &[ViewCount],
        decoys: &[ViewCount],
        least_expected: usize,
        config: &ExistenceConfig,
    ) -> Self {
        let at_least = |count: &ViewCount| count.at_least(least_expected);
        let edges: Vec<ViewCount> = edges.iter().map(at_least).collect();
        let [shown, expected] = totals(decoys.iter().map(|count| (count, 1.0)));
        // Half a view: nothing seen so far does not mean never.
        let coincidence_rate = within(
            (shown + 0.5) / (expected + 1.0),
            config.min_coincidence_rate,
            0.5,
        )
        .max(1e-6);
        let [low, high] = config.view_correlation.map(|rho| within(rho, 1e-3, 0.9));
        let mut model = Self {
            prior: possible(config.prior),
            detection_rate: config.usual_detection_rate,
            coincidence_rate,
            view_correlation: low,
            least_expected,
        };
        model.detection_rate = model.possible_detection_rate(model.detection_rate);
        for _ in 0..ITERATIONS {
            let weights: Vec<f64> = edges
                .iter()
                .map(|count| model.probability(*count))
                .collect();
            let weighted = || edges.iter().zip(weights.iter().copied());
            let true_edges: f64 = weights.iter().sum();
            let weight = config.prior_weight.max(1e-3);
            model.prior =
                possible((true_edges + config.prior * weight) / (edges.len() as f64 + weight));
            let [shown, expected] = totals(weighted());
            model.detection_rate = model.possible_detection_rate(
                (shown + DETECTION_RATE_WEIGHT * config.usual_detection_rate)
                    / (expected + DETECTION_RATE_WEIGHT),
            );
            let correlation = pairwise_correlation(weighted(), model.detection_rate);
            model.view_correlation = within(correlation.unwrap_or(low), low, high);
        }
        model
    }

    /// True edges are seen clearly more often than by coincidence.
    fn possible_detection_rate(&self, rate: f64) -> f64 {
        let least = within(2.0 * self.coincidence_rate, 0.1, 0.95);
        within(rate, least, 0.99)
    }

    /// The probability that an edge with these counts exists; never 0 or 1, and
    /// never less with more views that show the edge.
    pub(super) fn probability(&self, count: ViewCount) -> f64 {
        let count = count.at_least(self.least_expected);
        let log_odds = (self.prior / (1.0 - self.prior)).ln()
            + self.log_likelihood(count, self.detection_rate)
            - self.log_likelihood(count, self.coincidence_rate);
        let probability = 1.0 / (1.0 + (-log_odds).exp());
        possible(probability)
    }

    /// Logarithm of the beta-binomial probability with mean `rate`, but for the
    /// number of ways to choose the views.
    fn log_likelihood(&self, count: ViewCount, rate: f64) -> f64 {
        let concentration = self.view_correlation.recip() - 1.0;
        let rising =
            |start: f64, count: usize| -> f64 { (0..count).map(|i| (start + i as f64).ln()).sum() };
        rising(rate * concentration, count.showing)
            + rising((1.0 - rate) * concentration, count.expected - count.showing)
            - rising(concentration, count.expected)
    }
}

/// Neither 0 nor 1.
pub(super) fn possible(probability: f64) -> f64 {
    within(probability, MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
}

/// `x` between two bounds; `low` where it is no number.
fn within(x: f64, low: f64, high: f64) -> f64 {
    if x > low { x.min(high) } else { low }
}

/// Weighted sums of the views that show and of those that ought to.
fn totals<'a>(counts: impl Iterator<Item = (&'a ViewCount, f64)>) -> [f64; 2] {
    counts.fold([0.0; 2], |[shown, expected], (count, weight)| {
        [
            shown + weight * count.showing as f64,
            expected + weight * count.expected as f64,
        ]
    })
}

/// Correlation of two views of one edge, by the variance of the counts: that of a
/// beta-binomial is n p (1 - p) (1 + (n - 1) ρ). `None` without pairs of views.
fn pairwise_correlation<'a>(
    counts: impl Iterator<Item = (&'a ViewCount, f64)>,
    rate: f64,
) -> Option<f64> {
    let (mut excess, mut pairs) = (0.0, 0.0);
    for (count, weight) in counts {
        let views = count.expected as f64;
        let deviation = count.showing as f64 - views * rate;
        excess += weight * (deviation * deviation - views * rate * (1.0 - rate));
        pairs += weight * views * (views - 1.0) * rate * (1.0 - rate);
    }
    (pairs > 0.0).then(|| excess / pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn counts(pairs: &[(usize, usize)]) -> Vec<ViewCount> {
        pairs
            .iter()
            .map(|&(showing, expected)| ViewCount { showing, expected })
            .collect()
    }

    #[test]
    fn clear_cases_are_clear() {
        let edges = counts(&[(30, 40), (25, 38), (33, 41), (28, 40), (1, 40), (0, 35)]);
        let decoys = counts(&[(0, 40), (1, 38), (0, 30), (0, 41)]);
        let model = ExistenceModel::fit(&edges, &decoys, 0, &ExistenceConfig::default());
        assert!(model.detection_rate > 0.6 && model.coincidence_rate < 0.03);
        for edge in &edges[..4] {
            assert!(model.probability(*edge) > 0.95);
        }
        for edge in &edges[4..] {
            assert!(
                model.probability(*edge) < 0.1,
                "{}",
                model.probability(*edge)
            );
        }
        // Nobody could see it: nothing speaks for it or against it.
        let unseen = counts(&[(0, 0)])[0];
        assert!((model.probability(unseen) - model.prior).abs() < 1e-12);
        // Unless no edge is allowed to be seen nowhere.
        let model = ExistenceModel::fit(&edges, &decoys, 8, &ExistenceConfig::default());
        assert!(model.probability(unseen) < 0.3);
    }

    #[test]
    fn nothing_at_all_leaves_the_prior() {
        let config = ExistenceConfig::default();
        let model = ExistenceModel::fit(&[], &[], 0, &config);
        assert!((model.prior - config.prior).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn probabilities_grow_with_support(
            edges in prop::collection::vec((0usize..30, 0usize..30), 0..20),
            decoys in prop::collection::vec((0usize..30, 0usize..30), 0..20),
        ) {
            let counts = |pairs: Vec<(usize, usize)>| -> Vec<ViewCount> {
                let count = |(a, b): (usize, usize)| ViewCount {
                    showing: a.min(b),
                    expected: a.max(b),
                };
                pairs.into_iter().map(count).collect()
            };
            let (edges, decoys) = (counts(edges), counts(decoys));
            let model = ExistenceModel::fit(&edges, &decoys, 0, &ExistenceConfig::default());
            for expected in [1, 7, 40] {
                let mut before = 0.0;
                for showing in 0..=expected {
                    let now = model.probability(ViewCount { showing, expected });
                    prop_assert!(now > 0.0 && now < 1.0 && now >= before - 1e-12);
                    before = now;
                }
            }
        }
    }
}
