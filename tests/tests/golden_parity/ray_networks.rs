//! Case 03: the radiance and the attraction network.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use neat_field::AttractionNetworkConfig;
use neat_sdf::RenderingNetworkConfig;
use neat_tensor::PositionalEncoding;
use neat_tensor::parameters::load_parameters;
use neat_tensor::random::{Purpose, stream};
use neat_tests::backends::on_each_backend;
use neat_tests::comparison::assert_relatively_close;
use neat_tests::golden::Golden;
use neat_tests::named_gradients::{assert_gradients_close, named_gradients};
use neat_tests::published_names::{gradients, parameters};
use neat_tests::tensors::{golden_tensor, numbers};

const OUTPUT_TOLERANCE: f64 = 2e-6;
const GRADIENT_TOLERANCE: f64 = 1e-5;
const FEATURES: usize = 32;
const INPUTS: [&str; 4] = ["points", "view_dirs", "normals", "features"];

/// Which network, by the names of its golden tensors.
struct Case {
    network: &'static str,
    output: &'static str,
}

impl Case {
    /// Compares outputs and all gradients of an untrained network after loading
    /// the published parameters.
    fn check<M: Module>(
        &self,
        golden: &Golden,
        device: &Device,
        untrained: M,
        forward: impl Fn(&M, [Tensor<2>; 4]) -> Tensor<2>,
    ) {
        let Self { network, output } = self;
        let values = parameters(golden, &format!("{network}.param/"));
        let module = load_parameters(untrained, values, None).expect("published architecture");
        let inputs = INPUTS.map(|name| golden_tensor::<2>(golden, name, device).require_grad());
        let outputs = forward(&module, inputs.clone());
        let truth = golden.numbers(&format!("f64.{output}"));
        assert_relatively_close(output, &numbers(outputs.clone()), &truth, OUTPUT_TOLERANCE);

        // The ends [N, 2, 3] of a segment lie one after the other in [N, 6].
        let fixed = golden.numbers(&format!("fixed_{output}"));
        let fixed = Tensor::from_data(TensorData::new(fixed, outputs.dims()), device);
        let objective = (outputs * fixed).sum();
        let gradients_of_objective = objective.backward();
        for (name, input) in INPUTS.iter().zip(&inputs) {
            let gradient = input
                .grad(&gradients_of_objective)
                .expect("every input counts");
            let name = format!("f64.{network}.d/{name}");
            let truth = golden.numbers(&name);
            assert_relatively_close(&name, &numbers(gradient), &truth, GRADIENT_TOLERANCE);
        }
        assert_gradients_close(
            network,
            &named_gradients(&module, gradients_of_objective),
            &gradients(golden, &format!("f64.{network}.dparam/")),
            GRADIENT_TOLERANCE,
            GRADIENT_TOLERANCE,
        );
    }
}

#[test]
fn radiance() {
    let golden = Golden::open("03_rendering_attraction");
    on_each_backend(|device| {
        let config = RenderingNetworkConfig {
            width: 32,
            ..RenderingNetworkConfig::default()
        };
        let encoding = PositionalEncoding {
            octaves: config.view_octaves,
        };
        let encoded = encoding.encode(golden_tensor(&golden, "view_dirs", &device));
        let truth = golden.numbers("f64.view_embedding");
        assert_relatively_close("view encoding", &numbers(encoded), &truth, OUTPUT_TOLERANCE);

        let untrained = config
            .init(FEATURES, 1.0, &mut stream(0, Purpose::Weights, 0), &device)
            .expect("no grids");
        let case = Case {
            network: "rendering",
            output: "rgb",
        };
        case.check(
            &golden,
            &device,
            untrained,
            |network, [x, view, gradient, features]| {
                network.forward(Tensor::cat(vec![x, view], 1), gradient, features)
            },
        );
    });
}

#[test]
fn attraction() {
    let golden = Golden::open("03_rendering_attraction");
    on_each_backend(|device| {
        let config = AttractionNetworkConfig {
            width: 32,
            ..AttractionNetworkConfig::default()
        };
        let untrained = config
            .init(FEATURES, 1.0, &mut stream(0, Purpose::Weights, 0), &device)
            .expect("no grids");
        let case = Case {
            network: "attraction",
            output: "lines3d",
        };
        case.check(
            &golden,
            &device,
            untrained,
            |network, [x, view, gradient, features]| {
                network.forward(Tensor::cat(vec![x, view], 1), gradient, features)
            },
        );
    });
}
