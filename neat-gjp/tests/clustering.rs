//! Clustering against scikit-learn's results and against the definition.

#[path = "../../tests/data/golden/reader.rs"]
mod golden;

use golden::Golden;
use neat_gjp::clustering::dbscan_means;
use proptest::prelude::*;

fn points(golden: &Golden, name: &str) -> Vec<[f32; 3]> {
    let narrow = |row: [f64; 3]| row.map(|c| c as f32);
    golden.rows(name).into_iter().map(narrow).collect()
}

fn labels(golden: &Golden, name: &str) -> Vec<Option<usize>> {
    let label = |&n: &f64| (n >= 0.0).then_some(n as usize);
    golden.numbers(name).iter().map(label).collect()
}

#[test]
fn labels_and_means_are_scikit_learns() {
    let golden = Golden::open("08_dbscan");
    let clusters = dbscan_means(&points(&golden, "points"), 0.01, 2);
    assert_eq!(clusters.labels, labels(&golden, "labels"));

    let means = golden.rows::<3>("f64.cluster_means");
    assert_eq!(clusters.means.len(), means.len());
    for (mean, expected) in clusters.means.iter().zip(means) {
        for axis in 0..3 {
            assert!((f64::from(mean[axis]) - expected[axis]).abs() < 1e-6);
        }
    }
}

#[test]
fn the_radius_is_inclusive() {
    let golden = Golden::open("08_dbscan");
    let clusters = dbscan_means(&points(&golden, "boundary/points_eps0.5"), 0.5, 2);
    assert_eq!(clusters.labels, labels(&golden, "boundary/labels"));
}

#[test]
fn nothing_and_what_is_not_a_number_are_noise() {
    assert_eq!(dbscan_means(&[], 0.01, 2), Default::default());

    let points = [[f32::NAN; 3], [1.0; 3], [f32::INFINITY; 3], [1.0; 3]];
    assert_eq!(
        dbscan_means(&points, 0.1, 2).labels,
        [None, Some(0), None, Some(0)]
    );
    assert_eq!(
        dbscan_means(&points, 0.1, 0).labels,
        [None, Some(0), None, Some(0)]
    );
    assert_eq!(dbscan_means(&points[..1], 0.1, 1).labels, [None]);
    for eps in [f64::NAN, -1.0] {
        assert_eq!(dbscan_means(&points, eps, 2).labels, [None; 4]);
    }
    assert_eq!(dbscan_means(&points, 0.0, 2).means, [[1.0; 3]]);
}

/// Rays that hit nothing all render the same point.
#[test]
fn thousands_of_coincident_points_are_one_cluster() {
    let clusters = dbscan_means(&[[0.0; 3]; 3000], 0.01, 2);
    assert_eq!(clusters.labels, [Some(0); 3000]);
    assert_eq!(clusters.means, [[0.0; 3]]);
}

/// The definition, with every distance computed and core points found first.
fn naive_labels(points: &[[f32; 3]], eps: f64, min_samples: usize) -> Vec<Option<usize>> {
    let within = |a: usize, b: usize| {
        let difference = |axis| f64::from(points[a][axis]) - f64::from(points[b][axis]);
        (0..3).map(|axis| difference(axis).powi(2)).sum::<f64>() <= eps * eps
    };
    let all = 0..points.len();
    let is_core: Vec<bool> = all
        .clone()
        .map(|a| all.clone().filter(|&b| within(a, b)).count() >= min_samples)
        .collect();
    let mut labels = vec![None; points.len()];
    let mut count = 0;
    for seed in all.clone() {
        if !is_core[seed] || labels[seed].is_some() {
            continue;
        }
        labels[seed] = Some(count);
        loop {
            let reaches = |b: usize| {
                all.clone()
                    .any(|a| is_core[a] && labels[a] == Some(count) && within(a, b))
            };
            let reached = |b: &usize| labels[*b].is_none() && reaches(*b);
            let Some(next) = all.clone().find(reached) else {
                break;
            };
            labels[next] = Some(count);
        }
        count += 1;
    }
    labels
}

/// Coordinates on a grid, so that many distances lie exactly on the boundary and
/// many points coincide, or anywhere.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![3 => (0i32..8).prop_map(|i| i as f32 * 0.5), 1 => 0.0f32..4.0]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

    #[test]
    fn labels_follow_the_definition(
        points in prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..60),
        eps in prop_oneof![Just(0.5), Just(1.0), 0.0..1.5],
        min_samples in 1usize..6,
    ) {
        let clusters = dbscan_means(&points, eps, min_samples);
        prop_assert_eq!(&clusters.labels, &naive_labels(&points, eps, min_samples));

        for (label, mean) in clusters.means.iter().enumerate() {
            let members: Vec<_> = (0..points.len())
                .filter(|&i| clusters.labels[i] == Some(label))
                .collect();
            prop_assert!(!members.is_empty());
            for axis in 0..3 {
                let sum: f64 = members.iter().map(|&i| f64::from(points[i][axis])).sum();
                prop_assert!((sum / members.len() as f64 - f64::from(mean[axis])).abs() < 1e-6);
            }
        }
    }
}
