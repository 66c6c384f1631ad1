//! The network's gradient with respect to the point, and the gradients of losses
//! of it with respect to every parameter.

use burn::tensor::{DType, Int, Tensor, TensorData};
use neat_tensor::coordinate_mlp::Recorded;
use neat_tensor::linear::LinearInit;
use neat_tensor::parameters::{load_parameters, named_parameters};
use neat_tensor::random::{Purpose, stream};
use neat_tensor::{CoordinateMlp, Linear, PositionalEncoding};
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
    skip: Option<usize>,
    weight_norm: bool,
}

impl Settings {
    fn all() -> impl Iterator<Item = Self> {
        let skips = [None, Some(1), Some(2)];
        [0, 2, 6].into_iter().flat_map(move |octaves| {
            skips.into_iter().flat_map(move |skip| {
                [false, true].map(|weight_norm| Self {
                    octaves,
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
        let encoded = encoding.output_width(3);
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
            skip: self.skip,
            sharpness: SHARPNESS,
        };
        let parameters = named_parameters(&network);
        load_parameters(network, parameters, Some(DType::F64)).expect("its own parameters")
    }
}

fn points() -> Vec<f64> {
    normal(POINTS * 3, 11)
}

/// Rows out of order, one of them twice.
fn selection() -> Tensor<1, Int> {
    Tensor::from_data(TensorData::from([4i64, 0, 2, 4]), &flex())
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
fn selected_rows_are_rows_of_all() {
    for settings in Settings::all() {
        let network = settings.network();
        let recorded = network.record(constant(points(), [POINTS, 3]));
        let selected = recorded.select(selection());
        let of_all = |t: Tensor<2>| numbers(t.select(0, selection()));
        assert_eq!(
            numbers(selected.gradient(&network)),
            of_all(recorded.gradient(&network)),
            "{settings:?}"
        );
        assert_eq!(numbers(selected.outputs), of_all(recorded.outputs));
        assert_eq!(numbers(selected.points), of_all(recorded.points));
    }
}

/// A loss of outputs and gradient, linear in neither.
fn loss(network: &CoordinateMlp, rows: Option<Tensor<1, Int>>) -> Tensor<1> {
    let recorded = network.record(constant(points(), [POINTS, 3]));
    let of = |pass: &Recorded| {
        let [rows, outputs] = pass.outputs.dims();
        let weights = |count: usize, seed: u64| normal(count, seed);
        let of_outputs =
            pass.outputs.clone().square() * constant(weights(rows * outputs, 21), [rows, outputs]);
        let of_gradient =
            pass.gradient(network).square() * constant(weights(rows * 3, 22), [rows, 3]);
        of_outputs.sum() + of_gradient.sum()
    };
    match rows {
        None => of(&recorded),
        // All outputs count, the gradient at some rows only: as in training.
        Some(rows) => of(&recorded.select(rows)) + recorded.outputs.sum(),
    }
}

/// Compares each parameter's gradient with the difference along one random
/// direction: two evaluations per parameter instead of two per number.
fn check(settings: Settings, rows: Option<Tensor<1, Int>>) {
    let network = settings.network();
    let parameters = named_parameters(&network);
    let gradients = named_gradients(&network, loss(&network, rows.clone()).backward());
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
        numbers(loss(&moved, rows.clone()))[0]
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
        check(settings, None);
    }
}

#[test]
fn so_do_losses_at_selected_rows() {
    for settings in Settings::all() {
        check(settings, Some(selection()));
    }
}
