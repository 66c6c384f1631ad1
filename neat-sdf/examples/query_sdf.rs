//! A signed distance network as it is before training, a sphere, asked for distances
//! and gradients.
//!
//! ```text
//! cargo run --release -p neat-sdf --example query_sdf
//! ```

#![expect(clippy::print_stdout, reason = "an example shows its results")]

use burn::tensor::{Tensor, TensorData};
use neat_sdf::ImplicitNetworkConfig;
use neat_tensor::Backend;
use neat_tensor::random::{Purpose, stream};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let device = Backend::Flex.device()?;
    let config = ImplicitNetworkConfig {
        hidden_layers: 4,
        width: 64,
        features: 32,
        initial_sphere: 0.5,
        bounding_sphere_slope: 0.0,
        skip_layer: 0,
        ..ImplicitNetworkConfig::default()
    };
    // The geometric initialisation: about the distance from a sphere of radius 0.5.
    let network = config.init(1.0, &mut stream(0, Purpose::Weights, 0), &device)?;

    let points = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, -0.9, 0.0]];
    let data = TensorData::new(points.concat(), [points.len(), 3]);
    let output = network.evaluate(Tensor::from_data(data, &device)); // [N, 3]
    let sdf: Vec<f32> = output.sdf.into_data().try_to_vec()?;
    let gradients: Vec<f32> = output.gradient.into_data().try_to_vec()?;
    for ((point, sdf), gradient) in points.iter().zip(sdf).zip(gradients.chunks(3)) {
        println!("{point:?}: distance {sdf:.3}, gradient {gradient:.2?}");
    }
    Ok(())
}
