//! Case 06: rendering, all losses and all gradients of one training step; and
//! case 13: five steps of it with Adam.

use crate::segment_projection::camera;
use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::Device;
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, LineSegment2, ScoredSegment2};
use neat_gjp::JunctionCount;
use neat_gjp::candidates::{CandidateConfig, JunctionView};
use neat_pipeline::config::Config;
use neat_pipeline::config::Preset;
use neat_pipeline::distill::support_point;
use neat_sdf::{RayBundle, RaySamples};
use neat_tensor::adam::{Adam, AdamConfig};
use neat_tensor::parameters::{load_parameters, named_parameters};
use neat_tests::backends::on_each_backend;
use neat_tests::comparison::{assert_close, assert_relatively_close, count_beyond};
use neat_tests::golden::Golden;
use neat_tests::named_gradients::{assert_gradients_close, named_gradients};
use neat_tests::published_names::{model_gradients, model_parameters};
use neat_tests::tensors::numbers;
use neat_train::batch::{Batch, push_ray_through};
use neat_train::model::{NeatModel, PlacedSamples, RenderRequest};
use neat_train::{StepInput, StepLoss, step_loss};

/// How local junctions are found, by the names of the golden tensors.
const MODES: [&str; 2] = ["dbscan", "median"];
const SCENE_RADIUS: f64 = 3.0;
/// Length of the interval behind the last sample, as published.
const LAST_DELTA: f32 = 1e10;

/// The published configuration with the small networks of the golden cases.
fn config(mode: &str) -> Config {
    let mut config = Preset::PaperAbc.config();
    let model = &mut config.model;
    (model.implicit.width, model.implicit.features) = (64, 32);
    (model.rendering.width, model.attraction.width) = (32, 32);
    (model.perceiver.junctions, model.perceiver.width) = (JunctionCount::Fixed(64), 32);
    config.train.candidates = match mode {
        "median" => CandidateConfig::published_toy(),
        _ => CandidateConfig::published(),
    };
    config
}

fn model(golden: &Golden, prefix: &str, config: &Config, device: &Device) -> NeatModel {
    let untrained = NeatModel::new(&config.model, SCENE_RADIUS, 0, device);
    let untrained = untrained.expect("the published sizes");
    load_parameters(untrained, model_parameters(golden, prefix), None)
        .expect("the golden networks have the published architecture")
}

/// Everything that was drawn or observed in one published step.
struct RecordedStep {
    camera: Camera,
    junctions: Vec<Vector2<f64>>,
    batch: Batch,
    samples: RaySamples,
    eikonal_points: Vec<[f32; 3]>,
}

impl RecordedStep {
    fn read(golden: &Golden, prefix: &str) -> Self {
        let name = |name: &str| format!("{prefix}/{name}");
        let camera = camera(golden, &name("K"), &name("pose_c2w"));
        let mut rays = RayBundle::default();
        for pixel in golden.rows::<2>(&name("uv")) {
            push_ray_through(&mut rays, &camera, &Vector2::from(pixel));
        }
        let segment_of_ray = golden.rows::<5>(&name("lines2d"));
        let segment_of_ray = segment_of_ray.iter().enumerate();
        let segment_of_ray =
            segment_of_ray.map(|(edge, &[x1, y1, x2, y2, score])| ScoredSegment2 {
                segment: LineSegment2::new(Vector2::new(x1, y1), Vector2::new(x2, y2)),
                score,
                edge,
            });
        let z = golden.floats(&name("z_vals"));
        let per_ray = z.len() / rays.len();
        let deltas = z.chunks(per_ray).flat_map(|z| {
            let inner = z.windows(2).map(|pair| pair[1] - pair[0]);
            inner.chain([LAST_DELTA])
        });
        let mut eikonal_points = golden.float_rows::<3>(&name("eik_uniform"));
        let on_rays = golden.floats(&name("z_samples_eik"));
        eikonal_points.extend(
            on_rays
                .iter()
                .enumerate()
                .map(|(ray, z)| rays.point(ray, *z)),
        );
        Self {
            camera,
            junctions: golden
                .rows::<2>(&name("junctions2d"))
                .into_iter()
                .map(Vector2::from)
                .collect(),
            batch: Batch {
                colors: golden.float_rows(&name("rgb")),
                silhouette: vec![1.0; rays.len()],
                view_of_ray: vec![0; rays.len()],
                segment_of_ray: segment_of_ray.collect(),
                rays,
            },
            samples: RaySamples {
                per_ray,
                deltas: deltas.collect(),
                z,
            },
            eikonal_points,
        }
    }

    fn loss(&self, model: &NeatModel, config: &Config, device: &Device) -> StepLoss {
        let views = [JunctionView {
            camera: &self.camera,
            junctions_in_image: &self.junctions,
        }];
        let input = StepInput {
            batch: &self.batch,
            samples: PlacedSamples::OnHost(
                &self.samples,
                &model.implicit_network.distances(device),
            ),
            eikonal_points: &self.eikonal_points,
            eikonal_samples: None,
            surface_points: &[],
            views: &views,
            junctions_due: true,
        };
        let beta = model.density.beta();
        step_loss(model, &input, beta, &config.train, device).expect("finite ends can be matched")
    }
}

#[test]
fn rendering() {
    let golden = Golden::open("06_training_step");
    let step = RecordedStep::read(&golden, "in");
    on_each_backend(|device| {
        let model = model(&golden, "param/", &config("dbscan"), &device);
        let rendering = model.render(
            &RenderRequest {
                rays: &step.batch.rays,
                samples: PlacedSamples::OnHost(
                    &step.samples,
                    &model.implicit_network.distances(&device),
                ),
                beta: model.density.beta(),
                min_sample_weight: None,
                segment_rays: step.batch.rays.len(),
                color: true,
            },
            &device,
        );
        let check = |name: &str, actual: Vec<f64>, tolerance: f64| {
            let name = format!("common/{name}");
            assert_close(
                &name,
                &actual,
                &golden.numbers(&format!("f64.{name}")),
                tolerance,
            );
        };
        check("weights", numbers(rendering.weights), 3e-5);
        check(
            "rgb_values",
            numbers(rendering.color.expect("asked for")),
            5e-6,
        );
        check(
            "lines3d",
            numbers(rendering.segments.expect("asked for")),
            2e-5,
        );
        // Up to 100 at the far end of the rays, where the bounding sphere rules.
        let gradients = golden.numbers("common/samples/gradient");
        assert_relatively_close("gradients", &numbers(rendering.gradients), &gradients, 5e-6);
    });
}

#[test]
fn losses_and_gradients() {
    let golden = Golden::open("06_training_step");
    let step = RecordedStep::read(&golden, "in");
    let points = step.eikonal_points.as_flattened();
    let points: Vec<f64> = points.iter().map(|&x| f64::from(x)).collect();
    assert_close(
        "eikonal points",
        &points,
        &golden.numbers("common/eik_points"),
        1e-6,
    );
    on_each_backend(|device| {
        for mode in MODES {
            let config = config(mode);
            let model = model(&golden, "param/", &config, &device);
            let loss = step.loss(&model, &config, &device);
            let losses = loss.losses();
            for (name, term) in [
                ("loss", losses.total),
                ("rgb_loss", losses.rgb),
                ("eikonal_loss", losses.eikonal),
                ("line_loss", losses.segment),
                ("j3d_loss", losses.junction_3d),
                ("j2d_loss", losses.junction_2d),
            ] {
                let name = format!("f64.{mode}/loss/{name}");
                assert_relatively_close(&name, &[term], &golden.numbers(&name), 2e-5);
            }
            let targets = golden.shape(&format!("{mode}/j3d_local"))[0];
            assert_eq!(loss.targets, targets, "{mode}: matched junctions");
            let count = |e: &[f32]| e.iter().filter(|e| **e < 100.0).count() as f64;
            let counted = golden.number(&format!("{mode}/loss/count"));
            assert_eq!(
                count(&loss.segment_errors),
                counted,
                "{mode}: rays within 100 px"
            );
            assert_gradients_close(
                mode,
                &named_gradients(&model, loss.total.backward()),
                &model_gradients(&golden, &format!("f64.{mode}/dloss/")),
                1e-4,
                1e-5,
            );
        }
    });
}

#[test]
fn five_steps() {
    let golden = Golden::open("13_optimiser");
    let config = config("median");
    let rates = golden.numbers("f64.learning_rates");
    on_each_backend(|device| {
        let mut model = model(&golden, "param0/", &config, &device);
        let mut adam = Adam::new(AdamConfig::default());
        for (i, rate) in rates.iter().enumerate() {
            let step = RecordedStep::read(&golden, &format!("batch{i}"));
            let loss = step.loss(&model, &config, &device);
            let losses = loss.losses();
            let name = format!("f64.step{}/losses", i + 1);
            let [
                total,
                rgb,
                eikonal,
                segment,
                _,
                junction_3d,
                junction_2d,
                ..,
            ] = golden.numbers(&name)[..]
            else {
                panic!("{name}: nine losses")
            };
            let actual = [
                losses.total,
                losses.rgb,
                losses.eikonal,
                losses.segment,
                losses.junction_3d,
                losses.junction_2d,
            ];
            let truth = [total, rgb, eikonal, segment, junction_3d, junction_2d];
            for (actual, truth) in actual.iter().zip(truth) {
                assert_relatively_close(&name, &[*actual], &[truth], 1e-4);
            }
            let mut gradients = GradientsParams::from_grads(loss.total.backward(), &model);
            model = adam.step(model, &mut gradients, |_| *rate);
        }

        let parameters = named_parameters(&model);
        assert_eq!(
            parameters.len(),
            model_parameters(&golden, "f64.final/param/").len()
        );
        let mut actual = Vec::new();
        let mut truth = Vec::new();
        for (name, published) in model_gradients(&golden, "f64.final/param/") {
            actual.extend(parameters[&name].try_to_vec_as::<f32>().expect("float32"));
            truth.extend(published);
        }
        let actual: Vec<f64> = actual.into_iter().map(f64::from).collect();
        let beyond = count_beyond(&actual, &truth, 1e-5);
        assert!(
            beyond * 1000 <= actual.len(),
            "{beyond} of {} differ",
            actual.len()
        );
        // Adam moves a parameter of vanishing gradient by a whole step in either
        // direction.
        assert_close("parameters after five steps", &actual, &truth, rates[0]);
        assert_eq!(model.num_params(), actual.len());
    });
}

/// Tolerance of `l3d` in the golden README.
const SUPPORT_POINT_TOLERANCE: f64 = 1e-4;

#[test]
fn support_points_lie_on_the_tangent_plane() {
    let golden = Golden::open("06_training_step");
    let camera = camera(&golden, "in/K", "in/pose_c2w");
    let feet = golden.rows::<2>("in/uv_proj");
    let points = golden.rows::<3>("common/points3d");
    let gradients = golden.rows::<3>("common/points3d_gradient");
    let found: Vec<f64> = feet
        .into_iter()
        .zip(points.into_iter().zip(gradients))
        .flat_map(|(foot, (point, gradient))| {
            let ray = camera.ray_through(&foot.into());
            let point = support_point(&ray.origin, &ray.direction, &point.into(), &gradient.into());
            <[f64; 3]>::from(Vector3::from(point))
        })
        .collect();
    assert_close(
        "l3d",
        &found,
        &golden.numbers("f64.common/l3d"),
        SUPPORT_POINT_TOLERANCE,
    );
}

#[test]
fn the_learning_rate_falls_as_published() {
    let golden = Golden::open("13_optimiser");
    let train = Preset::PaperAbc.config().train;
    // The recorded schedule spans 100 iterations.
    let rates: Vec<f64> = (0..5)
        .map(|i| train.learning_rate * train.learning_rate_factor(i, i as f64 / 100.0))
        .collect();
    assert_close(
        "learning rate",
        &rates,
        &golden.numbers("f64.learning_rates"),
        1e-15,
    );
}
