//! The fused operations in float32 on each CPU backend against plain tensor
//! operations in float64.

use burn::module::{Module, Param};
use burn::tensor::{DType, Device, Tensor, TensorData};
use neat_tensor::linear::LinearInit;
use neat_tensor::parameters::{load_parameters, named_parameters};
use neat_tensor::random::{Purpose, stream};
use neat_tensor::{
    CoordinateMlp, Field, FieldQuery, GridConfig, GridEncoding, Kernels, KnownRows, Linear, Plain,
    PositionalEncoding, ReluMlp, SampleInputs,
};
use neat_tests::backends::{flex, on_each_cpu_backend};
use neat_tests::comparison::assert_relatively_close;
use neat_tests::finite_differences::{constant, normal};
use neat_tests::named_gradients::{assert_gradients_close, named_gradients};
use neat_tests::tensors::numbers;
use std::sync::Arc;

const VALUE_TOLERANCE: f64 = 5e-6;
const GRADIENT_TOLERANCE: f64 = 5e-5;
const OUTPUTS: usize = 5;

/// A signed distance network and the rows that it is asked about.
#[derive(Clone, Copy, Debug)]
struct Case {
    octaves: usize,
    /// Levels and features of learned grids.
    grid: Option<(usize, usize)>,
    skip: Option<usize>,
    weight_norm: bool,
    sharpness: f64,
    hidden: [usize; 3],
    rows: usize,
    light_rows: usize,
    others: bool,
}

const CASES: [Case; 9] = [
    // One row; widths below and beside any vector's.
    Case {
        octaves: 0,
        grid: None,
        skip: None,
        weight_norm: false,
        sharpness: 100.0,
        hidden: [5, 7, 3],
        rows: 1,
        light_rows: 0,
        others: true,
    },
    Case {
        octaves: 2,
        grid: None,
        skip: Some(1),
        weight_norm: true,
        sharpness: 100.0,
        hidden: [17, 33, 21],
        rows: 49,
        light_rows: 0,
        others: true,
    },
    Case {
        octaves: 6,
        grid: None,
        skip: Some(2),
        weight_norm: false,
        sharpness: 10.0,
        hidden: [64, 25, 64],
        rows: 130,
        light_rows: 0,
        others: false,
    },
    // Some rows in full, some not.
    Case {
        octaves: 3,
        grid: None,
        skip: None,
        weight_norm: false,
        sharpness: 100.0,
        hidden: [64, 64, 64],
        rows: 200,
        light_rows: 151,
        others: true,
    },
    Case {
        octaves: 1,
        grid: None,
        skip: Some(1),
        weight_norm: true,
        sharpness: 30.0,
        hidden: [40, 50, 60],
        rows: 97,
        light_rows: 48,
        others: false,
    },
    // Angles beyond what a short range reduction can do.
    Case {
        octaves: 16,
        grid: None,
        skip: None,
        weight_norm: false,
        sharpness: 100.0,
        hidden: [32, 32, 32],
        rows: 60,
        light_rows: 0,
        others: true,
    },
    // Learned grids, beside sines and alone, of all and of some rows.
    Case {
        octaves: 0,
        grid: Some((3, 2)),
        skip: None,
        weight_norm: false,
        sharpness: 20.0,
        hidden: [24, 33, 16],
        rows: 130,
        light_rows: 0,
        others: true,
    },
    Case {
        octaves: 2,
        grid: Some((2, 4)),
        skip: Some(2),
        weight_norm: true,
        sharpness: 20.0,
        hidden: [17, 33, 40],
        rows: 97,
        light_rows: 40,
        others: false,
    },
    Case {
        octaves: 1,
        grid: Some((1, 8)),
        skip: Some(1),
        weight_norm: false,
        sharpness: 20.0,
        hidden: [40, 20, 60],
        rows: 50,
        light_rows: 49,
        others: true,
    },
];

impl Case {
    fn network(&self, device: &Device) -> CoordinateMlp {
        let grid = self.grid(device);
        let sines = PositionalEncoding {
            octaves: self.octaves,
        };
        let encoded = sines.output_width(3) + grid.as_ref().map_or(0, |grid| grid.shape.width());
        let mut rng = stream(3, Purpose::Weights, 0);
        let mut inputs = encoded;
        let layers = self
            .hidden
            .into_iter()
            .chain([OUTPUTS])
            .enumerate()
            .map(|(l, outputs)| {
                if self.skip == Some(l) {
                    inputs += encoded;
                }
                let init = LinearInit::uniform(inputs, outputs, &mut rng);
                let layer = Linear::new(&init, inputs, outputs, self.weight_norm, device);
                inputs = outputs;
                layer
            })
            .collect();
        CoordinateMlp {
            layers,
            octaves: self.octaves,
            grid,
            skip: self.skip,
            sharpness: self.sharpness,
            kernels: Kernels::default(),
        }
    }

    /// Grids with entries of the size of their sums, the finest hashed.
    fn grid(&self, device: &Device) -> Option<GridEncoding> {
        let (levels, features) = self.grid?;
        let config = GridConfig {
            levels,
            features,
            log2_entries: 8,
            coarsest: 3,
            finest: 13,
        };
        let shape = config.shape(1.5);
        let values = normal(shape.entries() * features, 4);
        let values: Vec<f32> = values.into_iter().map(|x| 0.3 * x as f32).collect();
        let table = TensorData::new(values, [shape.entries(), features]);
        Some(GridEncoding {
            table: Param::from_data(table, device),
            shape,
        })
    }

    /// Float32 numbers, so that both sides see the same.
    fn points(&self) -> Vec<f64> {
        let points = normal(3 * self.rows, 5);
        points.into_iter().map(|x| f64::from(x as f32)).collect()
    }

    fn query(&self, known: Option<KnownRows>) -> FieldQuery {
        FieldQuery {
            light_rows: self.light_rows,
            known,
            others: self.others,
        }
    }

    /// A loss that every output enters linearly, with weights of its own.
    fn loss(&self, field: &Field) -> Tensor<1> {
        let weighted = |t: &Tensor<2>, seed: u64| {
            let shape = t.dims();
            let weights = TensorData::new(normal(shape[0] * shape[1], seed), shape);
            let options =
                burn::tensor::TensorCreationOptions::new(t.device()).with_dtype(t.dtype());
            (t.clone() * Tensor::from_data(weights.convert_dtype(t.dtype()), options)).sum()
        };
        let loss = weighted(&field.first, 1) + weighted(&field.gradient, 2);
        match &field.others {
            Some(others) => loss + weighted(others, 3),
            None => loss,
        }
    }
}

fn in_float64<M: Module>(module: M) -> M {
    let parameters = named_parameters(&module);
    load_parameters(module, parameters, Some(DType::F64)).expect("its own parameters")
}

fn float32(values: &[f64], shape: [usize; 2], device: &Device) -> Tensor<2> {
    let values: Vec<f32> = values.iter().map(|x| *x as f32).collect();
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn compare_fields(what: &str, field: &Field, truth: &Field) {
    let check = |name: &str, a: &Tensor<2>, t: &Tensor<2>| {
        assert_eq!(a.dims(), t.dims(), "{what}: {name}");
        let what = format!("{what}: {name}");
        let (actual, truth) = (numbers(a.clone()), numbers(t.clone()));
        assert_relatively_close(&what, &actual, &truth, VALUE_TOLERANCE);
    };
    check("first", &field.first, &truth.first);
    check("gradient", &field.gradient, &truth.gradient);
    match (&field.others, &truth.others) {
        (Some(a), Some(t)) => check("others", a, t),
        (a, t) => assert_eq!(a.is_some(), t.is_some(), "{what}: others"),
    }
}

#[test]
fn softplus_networks_agree_with_tensor_operations() {
    for case in CASES {
        // Angles of 2¹⁵ x are no better than float32 can tell them.
        let coarse = if case.octaves > 10 { 100.0 } else { 1.0 };
        let truth_network = in_float64(case.network(&flex()));
        let truth_points = constant(case.points(), [case.rows, 3]).require_grad();
        let truth = truth_network.field_by(&Plain, truth_points.clone(), case.query(None));
        let truth_gradients = case.loss(&truth).backward();
        let of_points = numbers(truth_points.grad(&truth_gradients).expect("tracked"));
        let of_parameters = named_gradients(&truth_network, truth_gradients);

        on_each_cpu_backend(|device| {
            let network = case.network(&device);
            let points = float32(&case.points(), [case.rows, 3], &device).require_grad();
            let field = network.field(points.clone(), case.query(None));
            let what = format!("{case:?}");
            if coarse == 1.0 {
                compare_fields(&what, &field, &truth);
            }
            let gradients = case.loss(&field).backward();
            if coarse == 1.0 {
                assert_relatively_close(
                    &format!("{what}: points"),
                    &numbers(points.grad(&gradients).expect("tracked")),
                    &of_points,
                    GRADIENT_TOLERANCE,
                );
            }
            assert_gradients_close(
                &what,
                &named_gradients(&network, gradients),
                &of_parameters,
                coarse * GRADIENT_TOLERANCE,
                coarse * GRADIENT_TOLERANCE,
            );
        });
    }
}

/// What an earlier pass said of the rows, in another order, changes nothing.
#[test]
fn known_rows_change_nothing() {
    for case in CASES {
        on_each_cpu_backend(|device| {
            let network = case.network(&device);
            let points = case.points();
            // The earlier pass saw the rows backwards.
            let backwards: Vec<f32> = points
                .chunks_exact(3)
                .rev()
                .flat_map(|p| [p[0] as f32, p[1] as f32, p[2] as f32])
                .collect();
            let on_host = network.on_host().expect("a CPU backend in float32");
            let pass = network.known_pass(&on_host, &backwards);
            let known = KnownRows {
                pass: Arc::new(pass.expect("room for a few rows")),
                rows: (0..case.rows as u32).rev().collect(),
            };
            let ask = |known: Option<KnownRows>| {
                let points = float32(&points, [case.rows, 3], &device);
                let field = network.field(points, case.query(known));
                let gradients = named_gradients(&network, case.loss(&field).backward());
                (field, gradients)
            };
            let what = format!("{case:?}");
            let (field, gradients) = ask(Some(known));
            let (truth, of_parameters) = ask(None);
            compare_fields(&what, &field, &truth);
            assert_gradients_close(
                &what,
                &gradients,
                &of_parameters,
                GRADIENT_TOLERANCE,
                GRADIENT_TOLERANCE,
            );
        });
    }
}

#[test]
fn relu_networks_agree_with_tensor_operations() {
    for rows in [1, 48, 131] {
        for weight_norm in [false, true] {
            let (rays, features) = (6, 9);
            let encoding = |octaves| PositionalEncoding { octaves };
            let ray_parts = vec![
                (0, 3, encoding(2)),
                (3, 3, encoding(0)),
                (1, 4, encoding(1)),
            ];
            let encoded: usize = ray_parts
                .iter()
                .map(|(_, width, encoding)| encoding.output_width(*width))
                .sum();
            let widths = [encoded + 3 + features, 33, 64, 6];
            let network = |device: &Device| {
                ReluMlp::new(
                    &widths,
                    weight_norm,
                    &mut stream(9, Purpose::Weights, 0),
                    device,
                )
            };
            let columns = [rays, 3, features];
            let values: Vec<Vec<f64>> = columns
                .iter()
                .zip(10..)
                .map(|(columns, seed)| {
                    let values = normal(rows * columns, seed);
                    values.into_iter().map(|x| f64::from(x as f32)).collect()
                })
                .collect();
            let inputs = |tensors: &[Tensor<2>]| SampleInputs {
                rays: tensors[0].clone(),
                ray_parts: ray_parts.clone(),
                gradients: tensors[1].clone(),
                features: tensors[2].clone(),
            };
            let weights = normal(rows * 6, 20);

            let truth_network = in_float64(network(&flex()));
            let truth_inputs: Vec<Tensor<2>> = values
                .iter()
                .zip(columns)
                .map(|(values, columns)| constant(values.clone(), [rows, columns]).require_grad())
                .collect();
            let truth = truth_network.forward_samples_by(&Plain, inputs(&truth_inputs));
            let loss = (truth.clone() * constant(weights.clone(), [rows, 6])).sum();
            let truth_gradients = loss.backward();
            let of_inputs: Vec<Vec<f64>> = truth_inputs
                .iter()
                .map(|x| numbers(x.grad(&truth_gradients).expect("tracked")))
                .collect();
            let of_parameters = named_gradients(&truth_network, truth_gradients);

            on_each_cpu_backend(|device| {
                let network = network(&device);
                let tensors: Vec<Tensor<2>> = values
                    .iter()
                    .zip(columns)
                    .map(|(values, columns)| {
                        float32(values, [rows, columns], &device).require_grad()
                    })
                    .collect();
                let out = network.forward_samples(inputs(&tensors));
                let what = format!("{rows} rows");
                assert_relatively_close(
                    &what,
                    &numbers(out.clone()),
                    &numbers(truth.clone()),
                    VALUE_TOLERANCE,
                );
                let gradients = (out * float32(&weights, [rows, 6], &device))
                    .sum()
                    .backward();
                for (x, truth) in tensors.iter().zip(&of_inputs) {
                    let gradient = numbers(x.grad(&gradients).expect("tracked"));
                    assert_relatively_close(&what, &gradient, truth, GRADIENT_TOLERANCE);
                }
                assert_gradients_close(
                    &what,
                    &named_gradients(&network, gradients),
                    &of_parameters,
                    GRADIENT_TOLERANCE,
                    GRADIENT_TOLERANCE,
                );
            });
        }
    }
}
