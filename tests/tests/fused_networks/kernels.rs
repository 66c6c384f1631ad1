//! The kernels on every instruction set of this machine, and with any number of
//! threads.

use neat_tensor::kernels::cpu::grid::GridShape;
use neat_tensor::kernels::cpu::layers::LayerShape;
use neat_tensor::kernels::cpu::relu_network::{PartShape, ReluNetwork, ReluShape};
use neat_tensor::kernels::cpu::softplus_network::{
    Known, SoftplusAdjoint, SoftplusNetwork, SoftplusShape,
};
use neat_tensor::kernels::cpu::{Arch, instruction_sets};
use neat_tests::comparison::assert_relatively_close;
use neat_tests::finite_differences::normal;

const OCTAVES: usize = 2;
const ENCODED: usize = 15;

fn random(count: usize, seed: u64, scale: f64) -> Vec<f32> {
    let numbers = normal(count, seed);
    numbers.into_iter().map(|x| (scale * x) as f32).collect()
}

fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|x| f64::from(*x)).collect()
}

fn layers(widths: &[usize]) -> Vec<LayerShape> {
    let pairs = widths.windows(2);
    pairs
        .map(|w| LayerShape {
            inputs: w[0],
            outputs: w[1],
        })
        .collect()
}

fn count(layers: &[LayerShape]) -> usize {
    layers.iter().map(LayerShape::parameters).sum()
}

/// Everything that a softplus network computes, one list after the other.
fn softplus_results(arch: Arch, rows: usize, full: usize, keep: bool) -> Vec<Vec<f32>> {
    // One dense and one hashed grid, whose cube does not hold all points.
    let grid = GridShape::new(&[4, 9], 2, 256, 1.5);
    let mut results = network_results(arch, rows, full, keep, None);
    results.extend(network_results(arch, rows, full, keep, Some(grid)));
    results
}

fn network_results(
    arch: Arch,
    rows: usize,
    full: usize,
    keep: bool,
    grid: Option<GridShape>,
) -> Vec<Vec<f32>> {
    let encoded = ENCODED + grid.as_ref().map_or(0, GridShape::width);
    let mut layers = layers(&[encoded, 21, 19, 40, 5]);
    layers[2].inputs += encoded;
    let table = grid
        .as_ref()
        .map_or(0, |grid| grid.entries() * grid.features);
    let shape = SoftplusShape {
        layers,
        octaves: OCTAVES,
        grid,
        skip: Some(2),
        sharpness: 20.0,
    };
    let parameters = random(count(&shape.layers), 1, 0.3);
    let network = SoftplusNetwork::new(arch, &shape, &parameters, random(table, 6, 0.3));
    let points = random(3 * rows, 2, 1.0);
    let (output, tape) = network.forward(&points[..3 * full], None, true, keep);
    let adjoint = SoftplusAdjoint {
        first: &random(rows, 3, 1.0),
        gradient: &random(3 * full, 4, 1.0),
        others: &random(4 * full, 5, 1.0),
    };
    let gradient = network.backward(&points, None, adjoint, tape, true);

    // The same rows, known from a pass over twice as many.
    let twice = [&points[..], &points[..]].concat();
    let pass = network.first_pass(&twice);
    let order: Vec<u32> = (rows as u32..2 * rows as u32).collect();
    let known = Known {
        pass: &pass,
        rows: &order,
    };
    let known_output = network
        .forward(&points[..3 * full], Some(known), true, false)
        .0;
    let known_gradient = network.backward(&points, Some(known), adjoint, None, false);
    assert_eq!(known_gradient.points, None);
    let of_table = gradient.table.unwrap_or_default();
    // Slopes of known rows come from the values, with another rounding.
    for (actual, truth) in [
        (&known_output.gradient, &output.gradient),
        (&known_gradient.parameters, &gradient.parameters),
        (&known_gradient.table.unwrap_or_default(), &of_table),
    ] {
        assert_relatively_close("known rows", &widen(actual), &widen(truth), 2e-5);
    }
    let values = [
        (&known_output.first[..], &output.first[..]),
        (&known_output.others, &output.others),
        (&pass.first[..full], &output.first),
    ];
    assert!(
        values.iter().all(|(a, b)| a == b),
        "known rows: other values"
    );

    vec![
        network.first(&points),
        output.first,
        output.gradient,
        output.others,
        gradient.parameters,
        of_table,
        gradient.points.expect("asked for"),
    ]
}

fn relu_results(arch: Arch, rows: usize, keep: bool) -> Vec<Vec<f32>> {
    let part = |source, column, width, octaves| PartShape {
        source,
        column,
        width,
        octaves,
    };
    let shape = ReluShape {
        layers: layers(&[15 + 2 + 9, 33, 16, 6]),
        sources: vec![6, 9],
        parts: vec![part(0, 0, 3, OCTAVES), part(0, 4, 2, 0), part(1, 0, 9, 0)],
    };
    let parameters = random(count(&shape.layers), 11, 0.3);
    let network = ReluNetwork::new(arch, &shape, &parameters);
    let sources = [random(6 * rows, 12, 1.0), random(9 * rows, 13, 1.0)];
    let sources = sources.each_ref().map(Vec::as_slice);
    let (out, tape) = network.forward(rows, &sources, keep);
    let adjoint = random(6 * rows, 14, 1.0);
    let (of_parameters, of_sources) =
        network.backward(rows, &sources, &adjoint, tape, &[true, false]);
    let mut of_sources = of_sources.into_iter();
    let first = of_sources.next().flatten().expect("asked for");
    assert_eq!(of_sources.next(), Some(None));
    vec![out, of_parameters, first]
}

/// Less than a block, a block, more; none at all.
const ROWS: [usize; 6] = [0, 1, 47, 48, 49, 150];

#[test]
fn every_instruction_set_computes_the_same() {
    for rows in ROWS {
        let full = rows.min(60);
        let truth = softplus_results(Arch::Scalar, rows, full, true);
        let relu_truth = relu_results(Arch::Scalar, rows, true);
        for arch in instruction_sets() {
            let softplus = softplus_results(arch, rows, full, true);
            let relu = relu_results(arch, rows, true);
            let results = softplus.iter().zip(&truth);
            for (actual, truth) in results.chain(relu.iter().zip(&relu_truth)) {
                assert_relatively_close(
                    &format!("{arch:?}, {rows} rows"),
                    &widen(actual),
                    &widen(truth),
                    2e-5,
                );
            }
        }
    }
}

#[test]
fn activations_kept_or_computed_again_give_the_same_bits() {
    for arch in instruction_sets() {
        for rows in ROWS {
            let full = rows.min(60);
            let kept = softplus_results(arch, rows, full, true);
            let again = softplus_results(arch, rows, full, false);
            assert!(kept == again, "softplus, {arch:?}, {rows} rows");
            let kept = relu_results(arch, rows, true);
            let again = relu_results(arch, rows, false);
            assert!(kept == again, "ReLU, {arch:?}, {rows} rows");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let results = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a few threads");
        pool.install(|| {
            (
                softplus_results(Arch::new(), 1000, 300, true),
                relu_results(Arch::new(), 1000, true),
            )
        })
    };
    let one = results(1);
    for threads in [2, 3, 7] {
        assert!(results(threads) == one, "{threads} threads");
    }
}
