//! The network's gradient with respect to the point, and the gradients of losses
//! of it with respect to every parameter.

use crate::grid_encoding::random_grid;
use burn::tensor::{DType, Tensor, TensorData};
use neat_tensor::linear::LinearInit;
use neat_tensor::parameters::{load_parameters, named_parameters};
use neat_tensor::random::{Purpose, stream};
use neat_tensor::{CoordinateMlp, FieldQuery, Kernels, Linear, PositionalEncoding};
use neat_tests::backends::flex;
use neat_tests::comparison::assert_relatively_close;
use neat_tests::finite_differences::{STEP, constant, normal};
use neat_tests::named_gradients::named_gradients;
use neat_tests::tensors::numbers;
use std::collections::BTreeMap;

const POINTS: usize = 6;
const OUTPUTS: usize = 4;
const HIDDEN_LAYERS: usize = 3;
const SHARPNESS: f64 = 100.0;

/// One architecture.
#[derive(Clone, Copy, Debug)]
struct Settings {
    octaves: usize,
    grid: bool,
    skip: Option<usize>,
    weight_norm: bool,
}

impl Settings {
    fn all() -> impl Iterator<Item = Self> {
        let skips = [None, Some(1), Some(2)];
        let encodings = [(0, false), (2, false), (6, false), (0, true), (2, true)];
        encodings.into_iter().flat_map(move |(octaves, grid)| {
            skips.into_iter().flat_map(move |skip| {
                [false, true].map(|weight_norm| Self {
                    octaves,
                    grid,
                    skip,
                    weight_norm,
                })
            })
        })
    }

    /// A random network in float64.
    fn network(self) -> CoordinateMlp {
        let encoding = PositionalEncoding {
            octaves: self.octaves,
        };
        let grid = self.grid.then(|| random_grid(2));
        let encoded = encoding.output_width(3) + grid.as_ref().map_or(0, |grid| grid.shape.width());
        let width = encoded + 5;
        let mut rng = stream(7, Purpose::Weights, 0);
        let layers = (0..=HIDDEN_LAYERS)
            .map(|l| {
                let inputs = if l == 0 { encoded } else { width };
                let outputs = match l {
                    HIDDEN_LAYERS => OUTPUTS,
                    _ if self.skip == Some(l + 1) => width - encoded,
                    _ => width,
                };
                let init = LinearInit::uniform(inputs, outputs, &mut rng);
                Linear::new(&init, inputs, outputs, self.weight_norm, &flex())
            })
            .collect();
        let network = CoordinateMlp {
            layers,
            octaves: self.octaves,
            grid,
            skip: self.skip,
            sharpness: SHARPNESS,
            kernels: Kernels::default(),
        };
        let parameters = named_parameters(&network);
        load_parameters(network, parameters, Some(DType::F64)).expect("its own parameters")
    }
}

fn points() -> Vec<f64> {
    normal(POINTS * 3, 11)
}

#[test]
fn the_gradient_is_that_of_the_first_output() {
    for settings in Settings::all() {
        let network = settings.network();
        let x = points();
        let recorded = network.record(constant(x.clone(), [POINTS, 3]));
        let gradient = numbers(recorded.gradient(&network));
        let first_output = |axis: usize, by: f64| {
            let mut x = x.clone();
            x.chunks_mut(3).for_each(|point| point[axis] += by);
            let outputs = network.forward(constant(x, [POINTS, 3]));
            numbers(outputs.narrow(1, 0, 1))
        };
        let mut differences = vec![0.0; POINTS * 3];
        for axis in 0..3 {
            let (ahead, behind) = (first_output(axis, STEP), first_output(axis, -STEP));
            for point in 0..POINTS {
                differences[3 * point + axis] = (ahead[point] - behind[point]) / (2.0 * STEP);
            }
        }
        assert_relatively_close(&format!("{settings:?}"), &gradient, &differences, 1e-6);
    }
}

#[test]
fn a_field_is_what_its_rows_say() {
    for settings in Settings::all() {
        let network = settings.network();
        let recorded = network.record(constant(points(), [POINTS, 3]));
        let field = network.field(constant(points(), [POINTS, 3]), query());
        let head = |t: Tensor<2>| numbers(t.narrow(0, 0, FULL_ROWS));
        assert_eq!(
            numbers(field.gradient),
            head(recorded.gradient(&network)),
            "{settings:?}"
        );
        assert_eq!(
            numbers(field.first),
            numbers(recorded.outputs.clone().narrow(1, 0, 1))
        );
        assert_eq!(
            numbers(field.others.expect("asked for")),
            head(recorded.outputs.narrow(1, 1, OUTPUTS - 1))
        );
    }
}

/// Rows that are evaluated in full.
const FULL_ROWS: usize = 4;

fn query() -> FieldQuery {
    FieldQuery {
        light_rows: POINTS - FULL_ROWS,
        known: None,
        others: true,
    }
}

/// A loss of outputs and gradient, linear in neither: of full rows everything
/// counts, of the others the first output.
fn loss(network: &CoordinateMlp) -> Tensor<1> {
    let field = network.field(constant(points(), [POINTS, 3]), query());
    let weighted = |t: Tensor<2>, seed: u64| {
        let [rows, columns] = t.dims();
        (t.square() * constant(normal(rows * columns, seed), [rows, columns])).sum()
    };
    weighted(field.first, 21)
        + weighted(field.others.expect("asked for"), 22)
        + weighted(field.gradient, 23)
}

/// Compares each parameter's gradient with the difference along one random
/// direction: two evaluations per parameter instead of two per number.
fn check(settings: Settings) {
    let network = settings.network();
    let parameters = named_parameters(&network);
    let gradients = named_gradients(&network, loss(&network).backward());
    let names: Vec<&String> = gradients.keys().collect();
    let moved = |name: &String, direction: &[f64], by: f64| {
        let mut parameters: BTreeMap<String, TensorData> = parameters.clone();
        let data = parameters
            .get_mut(name)
            .expect("a parameter of the network");
        let values: Vec<f64> = data.try_to_vec_as().expect("float64");
        let values = values.iter().zip(direction).map(|(v, d)| v + by * d);
        *data = TensorData::new(values.collect::<Vec<f64>>(), data.shape().to_vec());
        let moved = load_parameters(network.clone(), parameters, None).expect("the same shapes");
        numbers(loss(&moved))[0]
    };
    for (seed, name) in names.into_iter().enumerate() {
        let gradient = &gradients[name];
        let direction = normal(gradient.len(), 100 + seed as u64);
        let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
        let difference =
            (moved(name, &direction, STEP) - moved(name, &direction, -STEP)) / (2.0 * STEP);
        let what = format!("{settings:?} {name}");
        assert_relatively_close(&what, &[along], &[difference], 1e-5);
    }
}

#[test]
fn losses_of_outputs_and_gradient_train_all_parameters() {
    for settings in Settings::all() {
        check(settings);
    }
}
