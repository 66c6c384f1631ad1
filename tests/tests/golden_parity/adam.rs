//! Case 13: Adam alone, in float64, fed with the gradients that the published
//! training recorded.

use burn::module::{Module, Param};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use neat_tensor::adam::{Adam, AdamConfig};
use neat_tensor::parameters::named_parameters;
use neat_tests::backends::flex;
use neat_tests::comparison::assert_close;
use neat_tests::golden::Golden;
use neat_tests::tensors::{float64, golden_tensor, numbers};

const MATRICES: [&str; 5] = [
    "implicit_network.lin4.weight_v",
    "implicit_network.lin8.weight_g",
    "attraction_network.lin2.weight_v",
    "latents",
    "ffn.4.weight",
];
const VECTORS: [&str; 2] = ["rendering_network.lin0.bias", "density.beta"];

/// The parameters whose gradients were recorded.
#[derive(Module, Debug)]
struct Selected {
    matrices: Vec<Param<Tensor<2>>>,
    vectors: Vec<Param<Tensor<1>>>,
}

impl Selected {
    fn start(golden: &Golden) -> Self {
        fn read<const D: usize>(golden: &Golden, names: &[&str]) -> Vec<Param<Tensor<D>>> {
            let read = |name: &&str| {
                Param::from_tensor(golden_tensor(
                    golden,
                    &format!("param0/{name}"),
                    float64(&flex()),
                ))
            };
            names.iter().map(read).collect()
        }
        Self {
            matrices: read(golden, &MATRICES),
            vectors: read(golden, &VECTORS),
        }
    }

    fn gradients(&self, golden: &Golden, step: usize) -> GradientsParams {
        fn register<const D: usize>(
            gradients: &mut GradientsParams,
            golden: &Golden,
            step: usize,
            parameters: &[Param<Tensor<D>>],
            names: &[&str],
        ) {
            for (parameter, name) in parameters.iter().zip(names) {
                let name = format!("step{step}/grad/{name}");
                let gradient = golden_tensor::<D>(golden, &name, float64(&flex())).inner();
                gradients.register(parameter.id, gradient);
            }
        }
        let mut gradients = GradientsParams::new();
        register(&mut gradients, golden, step, &self.matrices, &MATRICES);
        register(&mut gradients, golden, step, &self.vectors, &VECTORS);
        gradients
    }

    fn assert_is_published(&self, golden: &Golden) {
        let truth = |name: &str| golden.numbers(&format!("f64.adam_alone/{name}"));
        for (parameter, name) in self.matrices.iter().zip(MATRICES) {
            assert_close(name, &numbers(parameter.val()), &truth(name), 1e-6);
        }
        for (parameter, name) in self.vectors.iter().zip(VECTORS) {
            assert_close(name, &numbers(parameter.val()), &truth(name), 1e-6);
        }
    }
}

fn take_steps(
    golden: &Golden,
    mut parameters: Selected,
    adam: &mut Adam,
    steps: std::ops::RangeInclusive<usize>,
) -> Selected {
    let rates = golden.numbers("f64.learning_rates");
    for step in steps {
        let mut gradients = parameters.gradients(golden, step);
        parameters = adam.step(parameters, &mut gradients, |_| rates[step - 1]);
    }
    parameters
}

#[test]
fn five_recorded_steps() {
    let golden = Golden::open("13_optimiser");
    let mut adam = Adam::new(AdamConfig::default());
    let parameters = take_steps(&golden, Selected::start(&golden), &mut adam, 1..=5);
    assert_eq!(adam.steps(), 5);
    parameters.assert_is_published(&golden);
}

#[test]
fn an_interruption_changes_nothing() {
    let golden = Golden::open("13_optimiser");
    let mut adam = Adam::new(AdamConfig::default());
    let at_once = take_steps(&golden, Selected::start(&golden), &mut adam, 1..=5);

    let mut adam = Adam::new(AdamConfig::default());
    let half_way = take_steps(&golden, Selected::start(&golden), &mut adam, 1..=2);
    let mut adam = Adam::restore(AdamConfig::default(), adam.steps(), adam.state());
    let resumed = take_steps(&golden, half_way, &mut adam, 3..=5);
    assert_eq!(named_parameters(&resumed), named_parameters(&at_once));
}
