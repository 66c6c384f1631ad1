//! One training step on what is made in memory: no scene, no folder, no run.
//!
//! ```text
//! cargo run --release -p neat-train --example train_step
//! ```

#![expect(clippy::print_stdout, reason = "an example shows its results")]

use burn::optim::GradientsParams;
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Intrinsics, LineSegment2, ScoredSegment2};
use neat_gjp::candidates::JunctionView;
use neat_sdf::ray_sampler::Deterministic;
use neat_tensor::Backend;
use neat_tensor::adam::Adam;
use neat_tensor::host::host_vec;
use neat_train::batch::{Batch, push_ray_through};
use neat_train::config::{ModelConfig, TrainConfig};
use neat_train::model::{NeatModel, PlacedSamples};
use neat_train::{StepInput, step_loss};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // One view of a 2D segment, and a ray through its middle.
    let camera = Camera {
        intrinsics: Intrinsics::centered(80.0, (64, 64)),
        world_from_camera: Matrix3::identity(),
        center_in_world: Vector3::new(0.0, 0.0, -2.0),
        width: 64,
        height: 64,
    };
    let segment = LineSegment2::new(Vector2::new(20.0, 30.0), Vector2::new(44.0, 34.0));
    let mut batch = Batch {
        colors: vec![[0.8, 0.2, 0.2]],
        silhouette: vec![1.0],
        view_of_ray: vec![0],
        segment_of_ray: vec![ScoredSegment2 {
            segment,
            score: 1.0,
            edge: 0,
        }],
        ..Batch::default()
    };
    push_ray_through(&mut batch.rays, &camera, &Vector2::new(32.0, 32.0));

    // The published networks and losses, samples placed by Algorithm 1 of VolSDF.
    let device = Backend::Flex.device()?.autodiff();
    let train = TrainConfig::default();
    let model = NeatModel::new(&ModelConfig::default(), 1.0, 0, &device)?;
    let distances = model.implicit_network.distances(&device);
    let beta = host_vec(model.density.beta())[0];
    let sampler = train.sampler.init(1.0, 0.2);
    let mut query = |points: &[[f32; 3]]| distances.capped(points);
    let samples = sampler.sample(&batch.rays, beta, &mut query, &mut Deterministic);

    // The paper's total loss, its gradients, and Adam's step.
    let views = [JunctionView {
        camera: &camera,
        junctions_in_image: &[segment.start],
    }];
    let input = StepInput {
        batch: &batch,
        samples: PlacedSamples::OnHost(&samples, &distances),
        eikonal_points: &[[0.1, 0.2, 0.3]],
        eikonal_samples: None,
        surface_points: &[],
        views: &views,
        junctions_due: true,
    };
    let loss = step_loss(&model, &input, model.density.beta(), &train, &device)?;
    println!("{:#?}", loss.losses());
    println!("the segment is {:.1} pixels off", loss.segment_errors[0]);
    let mut gradients = GradientsParams::from_grads(loss.total.backward(), &model);
    let model = Adam::new(train.adam).step(model, &mut gradients, |_| train.learning_rate);

    let after = step_loss(&model, &input, model.density.beta(), &train, &device)?;
    println!("total loss after the step: {:.4}", after.losses().total);
    Ok(())
}
