//! Products, activations, encodings and optimiser in float32 against plain tensor operations in
//! float64, which `finite_differences` checks: values and all gradients.

use burn::module::{Module, Param};
use burn::optim::GradientsParams;
use burn::tensor::{DType, Device, Tensor, TensorData};
use neat_tensor::adam::{Adam, AdamConfig};
use neat_tensor::random::{Purpose, standard_normal, stream};
use neat_tensor::softplus::{softplus, times_softplus_slope};
use neat_tensor::{GridEncoding, Kernels, NeatBackend, Plain, PositionalEncoding, RowChoice};
use neat_tests::backends::{flex, on_each_gpu_backend};
use neat_tests::comparison::assert_relatively_close;
use neat_tests::grids::small_grids;
use neat_tests::tensors::numbers;

/// Rows of the tensors: no multiple of any group of units.
const ROWS: usize = 1003;

/// Normal numbers of deviation `scale`.
fn normal(columns: usize, scale: f64, which: u64) -> TensorData {
    matrix(ROWS, columns, scale, which)
}

fn matrix(rows: usize, columns: usize, scale: f64, which: u64) -> TensorData {
    let mut rng = stream(which, Purpose::Weights, 0);
    let values: Vec<f32> = (0..rows * columns)
        .map(|_| (scale * standard_normal(&mut rng)) as f32)
        .collect();
    TensorData::new(values, [rows, columns])
}

/// Value and gradients of `function` at `inputs`, weighted by normal numbers.
fn value_and_gradients<const K: usize>(
    inputs: &[TensorData; K],
    device: &Device,
    dtype: DType,
    function: impl Fn([Tensor<2>; K]) -> Tensor<2>,
) -> Vec<Vec<f64>> {
    let tensor = |data: &TensorData| Tensor::<2>::from_data(data.clone(), (device, dtype));
    let leaves = inputs.each_ref().map(|data| tensor(data).require_grad());
    let value = function(leaves.clone());
    let weights = tensor(&normal(value.dims()[1], 1.0, 9));
    let gradients = (value.clone() * weights).sum().backward();
    let of_inputs = leaves.iter().map(|leaf| leaf.grad(&gradients));
    let mut all = vec![numbers(value)];
    all.extend(of_inputs.map(|gradient| numbers(gradient.expect("every input matters"))));
    all
}

/// `kernel` on every GPU against `plain` in float64, and which functions they are.
fn compare<const K: usize>(
    what: &str,
    inputs: &[TensorData; K],
    tolerance: f64,
    kernel: impl Fn([Tensor<2>; K]) -> Tensor<2>,
    plain: impl Fn([Tensor<2>; K]) -> Tensor<2>,
) {
    let truth = value_and_gradients(inputs, &flex(), DType::F64, plain);
    on_each_gpu_backend(|device| {
        let found = value_and_gradients(inputs, &device, DType::F32, &kernel);
        for (i, (found, truth)) in found.iter().zip(&truth).enumerate() {
            let part = ["value", "1st gradient", "2nd gradient", "3rd gradient"][i];
            assert_relatively_close(&format!("{what}, {part}"), found, truth, tolerance);
        }
    });
}

#[test]
fn softplus_and_its_slopes() {
    let kernels = Kernels::default();
    for sharpness in [1.0, 100.0] {
        // Both the bend and the far ends.
        for scale in [0.02, 3.0] {
            let [z, g] = [normal(7, scale, 1), normal(7, 1.0, 2)];
            compare(
                &format!("softplus {sharpness} at {scale}"),
                std::array::from_ref(&z),
                2e-6,
                |[z]| kernels.of(&z).softplus(z, sharpness),
                |[z]| softplus(z, sharpness),
            );
            compare(
                &format!("slope {sharpness} at {scale}"),
                &[g, z],
                5e-6,
                |[g, z]| kernels.of(&z).times_softplus_slope(g, z, sharpness),
                |[g, z]| times_softplus_slope(g, z, sharpness),
            );
        }
    }
}

#[test]
fn softplus_overflows_nowhere() {
    let far: [f64; 5] = [-1e30, -1e4, 0.0, 1e4, 1e30];
    on_each_gpu_backend(|device| {
        let z = Tensor::<2>::from_data([far.map(|z| z as f32)], &device);
        let kernels = Kernels::default();
        let backend = kernels.of(&z);
        let values = numbers(backend.softplus(z.clone(), 100.0));
        let slopes = numbers(backend.times_softplus_slope(z.ones_like(), z, 100.0));
        for (i, z) in far.into_iter().enumerate() {
            let (value, slope) = match z {
                0.0 => (2f64.ln() / 100.0, 0.5),
                z => (z.max(0.0), f64::from(u8::from(z > 0.0))),
            };
            assert!(
                (values[i] - value).abs() <= 1e-6 * value,
                "{z}: {}",
                values[i]
            );
            assert!((slopes[i] - slope).abs() <= 1e-6, "{z}: {}", slopes[i]);
        }
    });
}

#[test]
fn encoding_and_its_jacobian() {
    let kernels = Kernels::default();
    for (width, octaves) in [(3, 6), (3, 4), (5, 1)] {
        let encoding = PositionalEncoding { octaves };
        let x = normal(width, 1.0, 3);
        let gradient = normal(encoding.output_width(width), 1.0, 4);
        compare(
            &format!("encoding of {octaves} octaves"),
            std::array::from_ref(&x),
            2e-6,
            |[x]| kernels.of(&x).encode(encoding, x),
            |[x]| encoding.encode(x),
        );
        compare(
            &format!("pulled back through {octaves} octaves"),
            &[x, gradient],
            2e-6,
            |[x, gradient]| kernels.of(&x).pull_back(encoding, x, gradient),
            |[x, gradient]| encoding.pull_back(x, gradient),
        );
    }
}

/// More rows than are summed at once, and a rest.
#[test]
fn products_of_many_rows() {
    let kernels = Kernels::default();
    let [x, weight, bias] = [
        normal(7, 1.0, 5),
        matrix(5, 7, 1.0, 6),
        matrix(1, 5, 1.0, 7),
    ];
    let row = |bias: Tensor<2>| bias.reshape([5]);
    compare(
        "affine",
        &[x.clone(), weight.clone(), bias],
        1e-5,
        |[x, weight, bias]| kernels.of(&x).affine(x, weight, row(bias)),
        |[x, weight, bias]| Plain.affine(x, weight, row(bias)),
    );
    compare(
        "linear",
        &[x, matrix(7, 5, 1.0, 6)],
        1e-5,
        |[x, matrix]| kernels.of(&x).linear(x, matrix),
        |[x, matrix]| x.matmul(matrix),
    );
}

/// Rows that belong to many others, to one, and to none.
#[test]
fn rows_that_are_picked_and_added_up() {
    let kernels = Kernels::default();
    // Squares leave residues out.
    let squares =
        |count: u32, total: usize| RowChoice::new((0..count).map(|i| i * i % total as u32), total);
    for (total, columns) in [(17, 1), (401, 6), (5003, 3)] {
        let choice = squares(ROWS as u32, total);
        compare(
            &format!("rows of {total}"),
            &[matrix(total, columns, 1.0, 3)],
            1e-5,
            |[values]| kernels.of(&values).pick_rows(&choice, values),
            |[values]| choice.pick(values),
        );
    }
    for (count, columns) in [(400, 1), (3000, 6)] {
        let choice = squares(count, ROWS);
        compare(
            &format!("sums of {count} rows"),
            &[matrix(count as usize, columns, 1.0, 4)],
            1e-5,
            |[rows]| kernels.of(&rows).add_up_rows(&choice, rows),
            |[rows]| choice.add_up(rows),
        );
    }
}

/// Dense levels and one with a hash; many points share entries, some lie outside.
#[test]
fn learned_grids_and_their_pull_back() {
    let kernels = Kernels::default();
    for features in [1, 2, 4, 8] {
        let shape = small_grids(features);
        let grid = |table: Tensor<2>| GridEncoding {
            table: Param::from_tensor(table),
            shape: shape.clone(),
        };
        let [x, table] = [normal(3, 1.0, 3), matrix(shape.entries(), features, 1.0, 4)];
        compare(
            &format!("grids of {features} features"),
            &[x.clone(), table.clone()],
            1e-5,
            |[x, table]| kernels.of(&x).encode_grid(&grid(table), x),
            |[x, table]| grid(table).encode(x),
        );
        // Small ones, too: the table's derivatives are added as integers.
        for scale in [1.0, 1e-6] {
            let gradient = normal(shape.width(), scale, 5);
            compare(
                &format!("pulled back through grids of {features} features, times {scale}"),
                &[x.clone(), table.clone(), gradient],
                1e-5,
                |[x, table, gradient]| kernels.of(&x).pull_back_grid(&grid(table), x, gradient),
                |[x, table, gradient]| grid(table).pull_back(x, gradient),
            );
        }
    }
}

/// A parameter to be optimised.
#[derive(Module, Debug)]
struct Parameter {
    matrix: Param<Tensor<2>>,
}

#[test]
fn steps_of_adam() {
    const STEPS: u64 = 3;
    let start = normal(4, 1.0, 5);
    let after_steps = |device: &Device, dtype: DType| {
        let tensor = |data: TensorData| Tensor::<2>::from_data(data, (device, dtype));
        let mut parameter = Parameter {
            matrix: Param::from_tensor(tensor(start.clone()).require_grad()),
        };
        let mut adam = Adam::new(AdamConfig::default());
        for step in 0..STEPS {
            let weights = tensor(normal(4, 1.0, 6 + step));
            let loss = (parameter.matrix.val() * weights).sum();
            let mut gradients = GradientsParams::from_grads(loss.backward(), &parameter);
            parameter = adam.step(parameter, &mut gradients, |_| 0.01);
        }
        let [first, second] = adam.state()["matrix"].clone();
        let moved = numbers(parameter.matrix.val()).into_iter();
        let start = start.iter::<f64>();
        [
            moved.zip(start).map(|(to, from)| to - from).collect(),
            first.iter::<f64>().collect::<Vec<_>>(),
            second.iter::<f64>().collect(),
        ]
    };
    let truth = after_steps(&flex(), DType::F64);
    on_each_gpu_backend(|device| {
        let found = after_steps(&device, DType::F32);
        // A move is the small difference of two parameters.
        let parts = [("move", 2e-5), ("mean", 2e-6), ("square", 2e-6)];
        for ((what, tolerance), (found, truth)) in parts.iter().zip(found.iter().zip(&truth)) {
            assert_relatively_close(&format!("Adam's {what}"), found, truth, *tolerance);
        }
    });
}
