//! Case 05: VolSDF's Algorithm 1, iteration by iteration.
//!
//! The last evenly spaced number is exactly 1 and falls anywhere on the flat end
//! of the cumulative distribution: positions are compared by the rule of the
//! golden data's README, not one by one. What the jump does to a ray differs between
//! matrix products: one ray per number may fall out.

use crate::implicit_network::network;
use crate::volume_rendering::deltas;
use burn::tensor::{DType, Device, Tensor, TensorData};
use neat_sdf::density::laplace_density;
use neat_sdf::ray_sampler::{ErrorBoundConfig, ErrorBoundTrace, RayBundle, SamplingNoise};
use neat_sdf::volume_rendering::{integrate, rendering_weights};
use neat_tests::backends::{flex, on_each_backend};
use neat_tests::comparison::{assert_close, count_beyond};
use neat_tests::golden::Golden;
use neat_tests::tensors::{float64, numbers};

/// Positions further apart than this are not the same.
const SAME_POSITION: f64 = 1e-4;

/// Of β on the one ray that rounding may move a sample of.
const BETA_WITH_MOVED_SAMPLE: f64 = 1e-4;
/// Of the rendered depth on that ray.
const DEPTH_WITH_MOVED_SAMPLE: f64 = 2e-3;

/// Tolerances of one run.
struct Run {
    tag: &'static str,
    beta: f64,
    depth: f64,
    /// Of every final position, where no sample sits on the flat end.
    positions: Option<f64>,
}

/// The random decisions that the published code drew, or none in evaluation.
struct Recorded {
    uniform: std::vec::IntoIter<Vec<f32>>,
    columns: Option<Vec<usize>>,
}

impl Recorded {
    fn of(golden: &Golden, tag: &str) -> Self {
        if !tag.starts_with("train") {
            return Self {
                uniform: Vec::new().into_iter(),
                columns: None,
            };
        }
        let floats = |name: &str| golden.floats(&format!("{tag}/{name}"));
        Self {
            uniform: vec![floats("rand_uniform_jitter"), floats("rand_final_u")].into_iter(),
            columns: Some(golden.indices(&format!("{tag}/randperm_extra"))),
        }
    }
}

impl SamplingNoise for Recorded {
    fn uniform(&mut self, count: usize) -> Option<Vec<f32>> {
        self.columns.as_ref()?;
        let numbers = self.uniform.next().expect("only two draws were recorded");
        assert_eq!(numbers.len(), count);
        Some(numbers)
    }

    fn columns(&mut self, available: usize, wanted: usize) -> Vec<usize> {
        match &self.columns {
            Some(columns) => {
                assert_eq!(columns.len(), wanted);
                columns.clone()
            }
            None => neat_sdf::ray_sampler::Deterministic.columns(available, wanted),
        }
    }
}

fn rays(golden: &Golden) -> RayBundle {
    RayBundle {
        origins: golden.float_rows("cam_loc"),
        directions: golden.float_rows("ray_dirs"),
    }
}

/// Depth that the float32 positions `z` render in float64.
fn rendered_depth(golden: &Golden, rays: &RayBundle, z: &[f32], beta: f64) -> Vec<f64> {
    let device = flex();
    let options = float64(&device);
    let per_ray = z.len() / rays.len();
    let points: Vec<f64> = z
        .iter()
        .enumerate()
        .flat_map(|(i, z)| {
            let (o, d) = (rays.origins[i / per_ray], rays.directions[i / per_ray]);
            [0, 1, 2].map(|axis| f64::from(o[axis]) + f64::from(*z) * f64::from(d[axis]))
        })
        .collect();
    let points = TensorData::new(points, [z.len(), 3]);
    let sdf = network(golden, &device, Some(DType::F64))
        .sdf(Tensor::from_data(points, options.clone()))
        .reshape([rays.len(), per_ray]);
    let z: Vec<f64> = z.iter().map(|&z| f64::from(z)).collect();
    let z = Tensor::<2>::from_data(TensorData::new(z, [rays.len(), per_ray]), options.clone());
    let beta = Tensor::from_data(TensorData::from([beta]), options);
    let weights = rendering_weights(laplace_density(sdf, beta), deltas(&z));
    numbers(integrate(weights, z.reshape([rays.len() * per_ray, 1])))
}

impl Run {
    fn check(&self, golden: &Golden, device: &Device) {
        let tag = self.tag;
        let network = network(golden, device, None);
        let mut query = |points: &[[f32; 3]]| {
            let data = TensorData::new(points.as_flattened().to_vec(), [points.len(), 3]);
            let sdf = network.sdf(Tensor::from_data(data, device));
            sdf.try_into_vec_as::<f32>().expect("float32")
        };
        let rays = rays(golden);
        let beta = golden.number(&format!("{tag}/beta_param")).abs() + 1e-4;
        let mut trace = ErrorBoundTrace::default();
        let samples = ErrorBoundConfig::default().sample(
            &rays,
            beta as f32,
            &mut query,
            &mut Recorded::of(golden, tag),
            Some(&mut trace),
        );

        let counts: Vec<usize> = trace.z.iter().map(|z| z.len() / rays.len()).collect();
        let published = golden.indices(&format!("{tag}/n_samples_per_iteration"));
        assert_eq!(counts, published, "{tag}: samples per iteration");
        for (i, beta) in trace.beta.iter().enumerate() {
            let name = format!("f64.{tag}/it{i}/beta");
            let truth = golden.numbers(&name);
            assert_rays_close(
                &name,
                &wide(beta),
                &truth,
                self.beta,
                BETA_WITH_MOVED_SAMPLE,
            );
        }
        if let Some(second) = trace.z.get(1) {
            let second = wide(second);
            let per_ray = counts[1];
            let published = golden.numbers(&format!("{tag}/it1/z"));
            for (ray, (z, truth)) in second
                .chunks(per_ray)
                .zip(published.chunks(per_ray))
                .enumerate()
            {
                // A moved sample shifts the ranks of those it passes: compare as sets.
                assert!(moved(z, truth) <= 1, "{tag}: ray {ray} of iteration 1");
            }
        }

        let z = wide(&samples.z);
        let published = golden.numbers(&format!("f64.{tag}/z_vals"));
        let different = count_beyond(&z, &published, SAME_POSITION);
        assert!(
            different * 10 <= z.len(),
            "{tag}: {different} of {} positions differ",
            z.len()
        );
        if let Some(tolerance) = self.positions {
            assert_close(&format!("{tag} positions"), &z, &published, tolerance);
        }
        let depth = rendered_depth(golden, &rays, &samples.z, beta);
        let published = golden.numbers(&format!("f64.{tag}/rendered_depth_from_z_vals"));
        let name = format!("{tag} depth");
        assert_rays_close(
            &name,
            &depth,
            &published,
            self.depth,
            DEPTH_WITH_MOVED_SAMPLE,
        );
    }
}

/// Compares a number per ray: one ray, a sample of which may have moved, need only
/// be within `with_moved_sample`.
#[track_caller]
fn assert_rays_close(
    what: &str,
    actual: &[f64],
    truth: &[f64],
    tolerance: f64,
    with_moved_sample: f64,
) {
    let beyond = count_beyond(actual, truth, tolerance);
    assert!(beyond <= 1, "{what}: {beyond} rays beyond {tolerance:.0e}");
    assert_close(what, actual, truth, with_moved_sample.max(tolerance));
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&x| f64::from(x)).collect()
}

/// How many of the sorted positions `z` have no partner in the sorted `truth`.
fn moved(z: &[f64], truth: &[f64]) -> usize {
    let mut partners = truth.iter().peekable();
    let mut alone = 0;
    for &position in z {
        while partners
            .next_if(|&&other| other < position - SAME_POSITION)
            .is_some()
        {}
        if partners
            .next_if(|&&other| other <= position + SAME_POSITION)
            .is_none()
        {
            alone += 1;
        }
    }
    alone
}

#[test]
fn evaluation_follows_the_published_iterations() {
    let golden = Golden::open("05_error_bound_sampler");
    on_each_backend(|device| {
        for (tag, positions) in [
            ("eval_b0.05", None),
            ("eval_b0.005", None),
            ("eval_b0.3", Some(5e-4)),
        ] {
            let run = Run {
                tag,
                beta: 1e-6,
                depth: 2e-4,
                positions,
            };
            run.check(&golden, &device);
        }
    });
}

#[test]
fn training_follows_the_published_random_decisions() {
    let golden = Golden::open("05_error_bound_sampler");
    on_each_backend(|device| {
        let run = Run {
            tag: "train_b0.05",
            beta: 2e-3,
            depth: 2e-3,
            positions: None,
        };
        run.check(&golden, &device);
    });
}
