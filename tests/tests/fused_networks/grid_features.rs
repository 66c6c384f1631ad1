//! Features of learned grids as an operation of their own: against the twin in tensor
//! operations, on every instruction set, and with any number of threads.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use neat_tensor::kernels::cpu::grid::GridShape;
use neat_tensor::kernels::cpu::{Arch, instruction_sets};
use neat_tensor::{GridConfig, GridEncoding, Kernels};
use neat_tests::backends::on_each_cpu_backend;
use neat_tests::comparison::assert_relatively_close;
use neat_tests::finite_differences::{constant, normal};
use neat_tests::tensors::numbers;

const CONFIG: GridConfig = GridConfig {
    levels: 3,
    features: 2,
    log2_entries: 8,
    coarsest: 3,
    finest: 13,
};

/// Normally distributed numbers that float32 holds exactly.
fn exact(count: usize, seed: u64) -> Vec<f64> {
    let values = normal(count, seed).into_iter();
    values.map(|x| f64::from(x as f32)).collect()
}

fn narrow(values: &[f64]) -> Vec<f32> {
    values.iter().map(|x| *x as f32).collect()
}

/// Features, and the gradients of a sum of them with respect to points and table. Some
/// points lie outside of the cube.
fn results(
    shape: &GridShape,
    rows: usize,
    tensor: impl Fn(Vec<f64>, [usize; 2]) -> Tensor<2>,
    features: impl Fn(&GridEncoding, Tensor<2>) -> Tensor<2>,
) -> [Vec<f64>; 3] {
    let size = [shape.entries(), shape.features];
    let table = tensor(exact(size[0] * size[1], 4), size).require_grad();
    let points = tensor(exact(3 * rows, 5), [rows, 3]).require_grad();
    let grid = GridEncoding {
        table: Param::from_tensor(table),
        shape: shape.clone(),
    };
    let out = features(&grid, points.clone());
    let weights = tensor(exact(rows * shape.width(), 6), [rows, shape.width()]);
    let gradients = (out.clone() * weights).sum().backward();
    let of_points = points.grad(&gradients).expect("tracked");
    let of_table = grid.table.val().grad(&gradients).expect("tracked");
    [
        out,
        Tensor::from_inner(of_points),
        Tensor::from_inner(of_table),
    ]
    .map(numbers)
}

#[test]
fn features_agree_with_tensor_operations() {
    for (features, rows) in [(1, 1), (2, 17), (4, 300), (8, 700)] {
        let shape = GridConfig { features, ..CONFIG }.shape(1.5);
        let hashed = shape.levels.iter().filter(|level| level.mask.is_some());
        assert_eq!(hashed.count(), 2);
        let truth = results(&shape, rows, constant, |grid, x| grid.encode(x));
        on_each_cpu_backend(|device: Device| {
            let tensor = |values: Vec<f64>, size| {
                Tensor::from_data(TensorData::new(narrow(&values), size), &device)
            };
            let actual = results(&shape, rows, tensor, |grid, x| {
                Kernels::default().of(&x).encode_grid(grid, x)
            });
            let what = ["features", "points", "table"];
            for ((what, actual), truth) in what.iter().zip(&actual).zip(&truth) {
                let what = format!("{what}, {features} features, {rows} rows");
                assert_relatively_close(&what, actual, truth, 2e-5);
            }
        });
    }
}

/// Features and both gradients of the kernels alone.
fn of_kernels(arch: Arch, rows: usize) -> [Vec<f32>; 3] {
    let shape = CONFIG.shape(1.5);
    let points = narrow(&normal(3 * rows, 5));
    let table = narrow(&normal(shape.entries() * shape.features, 4));
    let adjoint = narrow(&normal(rows * shape.width(), 6));
    [
        shape.features_at(arch, &points, &table),
        shape.features_to_points(arch, &points, &table, &adjoint),
        shape.features_to_table(arch, &points, &adjoint),
    ]
}

#[test]
fn every_instruction_set_gives_the_same_features() {
    let widen = |values: &[f32]| -> Vec<f64> { values.iter().map(|x| f64::from(*x)).collect() };
    for rows in [0, 1, 16, 257] {
        let truth = of_kernels(Arch::Scalar, rows);
        for arch in instruction_sets() {
            for (actual, truth) in of_kernels(arch, rows).iter().zip(&truth) {
                let what = format!("{arch:?}, {rows} rows");
                assert_relatively_close(&what, &widen(actual), &widen(truth), 2e-5);
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_features() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("a few threads");
        pool.install(|| of_kernels(Arch::new(), 1000))
    };
    let one = with(1);
    for threads in [2, 5] {
        assert!(with(threads) == one, "{threads} threads");
    }
}
