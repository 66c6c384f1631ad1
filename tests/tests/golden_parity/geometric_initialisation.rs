//! Case 02: what the untrained network of full size looks like. Random draws
//! differ between the two implementations, so statistics are compared.

use burn::tensor::{Tensor, TensorData};
use neat_sdf::ImplicitNetworkConfig;
use neat_tensor::random::{Purpose, standard_normal, stream};
use neat_tests::backends::flex;
use neat_tests::golden::Golden;
use neat_tests::tensors::numbers;

/// As many as the golden statistics have.
const SEEDS: u64 = 20;
const DIRECTIONS: usize = 64;
const SCENE_RADIUS: f64 = 3.0;
/// 0.2 of the scene's radius.
const SPHERE_RADIUS: f64 = 0.6;

/// Statistics over directions, per radius.
struct Statistics {
    /// Mean of sdf − (|x| − 0.6).
    mean_deviation: Vec<f64>,
    /// Its standard deviation.
    spread: Vec<f64>,
    /// Mean length of the gradient.
    slope: Vec<f64>,
}

fn statistics(radii: &[f64], seed: u64) -> Statistics {
    let mut rng = stream(seed, Purpose::Weights, 0);
    let network = ImplicitNetworkConfig::default().init(SCENE_RADIUS, &mut rng, &flex());
    let network = network.expect("the published size");
    let directions: Vec<[f64; 3]> = (0..DIRECTIONS)
        .map(|_| {
            let v = [0; 3].map(|_| standard_normal(&mut rng));
            let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
            v.map(|x| x / length)
        })
        .collect();
    let points: Vec<f64> = radii
        .iter()
        .flat_map(|r| directions.iter().flatten().map(move |d| r * d))
        .collect();
    let points = TensorData::new(points, [radii.len() * DIRECTIONS, 3]);
    let points = Tensor::from_data(points, &flex());
    let output = network.evaluate_uncapped(points);
    let slopes = numbers(output.gradient.square().sum_dim(1).sqrt());
    let sdf = numbers(output.sdf);

    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mut statistics = Statistics {
        mean_deviation: Vec::new(),
        spread: Vec::new(),
        slope: slopes.chunks(DIRECTIONS).map(mean).collect(),
    };
    for (radius, sdf) in radii.iter().zip(sdf.chunks(DIRECTIONS)) {
        let deviations: Vec<f64> = sdf.iter().map(|d| d - (radius - SPHERE_RADIUS)).collect();
        let center = mean(&deviations);
        let squares: Vec<f64> = deviations.iter().map(|d| (d - center).powi(2)).collect();
        statistics.mean_deviation.push(center);
        statistics.spread.push(mean(&squares).sqrt());
    }
    statistics
}

#[test]
fn the_untrained_network_has_the_published_statistics() {
    let golden = Golden::open("02_geometric_init");
    let radii = golden.numbers("radii");
    let of_seeds: Vec<Statistics> = (0..SEEDS).map(|seed| statistics(&radii, seed)).collect();
    let mean =
        |value: &dyn Fn(&Statistics) -> f64| of_seeds.iter().map(value).sum::<f64>() / SEEDS as f64;
    let (lowest, highest, center) = (
        golden.numbers("twenty_seeds.dev_mean_min"),
        golden.numbers("twenty_seeds.dev_mean_max"),
        golden.numbers("twenty_seeds.dev_mean_mean"),
    );
    for (i, radius) in radii.iter().enumerate() {
        let deviation = mean(&|s| s.mean_deviation[i]);
        // Twenty normal draws span 3.7 deviations, and two means of twenty differ by
        // 0.32 of one: a quarter of the span is three times that.
        let tolerance = (highest[i] - lowest[i]) / 4.0;
        assert!(
            (deviation - center[i]).abs() < tolerance,
            "radius {radius}: mean deviation {deviation}, published {}",
            center[i]
        );
    }

    let three_seeds = |name: &str, i: usize| {
        let published = (0..3).map(|s| golden.numbers(&format!("seed{s}.{name}"))[i]);
        published.sum::<f64>() / 3.0
    };
    for (i, radius) in radii.iter().enumerate().skip(1) {
        let (spread, published) = (mean(&|s| s.spread[i]), three_seeds("dev_std", i));
        assert!(
            (spread / published - 1.0).abs() < 0.35,
            "radius {radius}: spread {spread}, published {published}"
        );
        let (slope, published) = (mean(&|s| s.slope[i]), three_seeds("grad_norm_mean", i - 1));
        assert!(
            (slope - published).abs() < 0.08,
            "radius {radius}: slope {slope}, published {published}"
        );
    }
}
