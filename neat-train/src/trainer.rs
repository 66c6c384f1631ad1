//! The optimisation of one scene.

use crate::awake::with_awake_worker;
use crate::checkpoint_metadata::{AVERAGE_LOSS, LEARNING_RATE_SCALE, metadata};
use crate::chunked_step::{StepGradients, chunked_step};
use crate::config::{TrainConfig, TrainingConfig};
use crate::error::TrainError;
use crate::field::TrainedField;
use crate::flops::StepRows;
use crate::losses::{Losses, StepInput, StepLoss, step_loss};
use crate::model::{NeatModel, host_points, host_vec};
use crate::sample_placement::{SamplePlacement, StepSamples, StepToSample};
use crate::surface_points::SurfacePoints;
use crate::training_data::{Batch, TrainingData};
use burn::module::Module;
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};
use neat_core::Scene;
use neat_core::assignment::AssignmentError;
use neat_gjp::candidates::JunctionView;
use neat_sdf::ImplicitNetwork;
use neat_sdf::density::BetaSchedule;
use neat_tensor::adam::Adam;
use neat_tensor::checkpoint::Checkpoint;
use neat_tensor::fused::is_fused;
use neat_tensor::parameters::{GradientCheck, load_parameters, named_parameters};
use neat_tensor::random::{Purpose, stream};
use rand::RngExt;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A step counts in the average loss with one of so many parts.
const AVERAGED_STEPS: f64 = 50.0;

/// What one iteration did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// The iteration that was done, counted from 1.
    pub iteration: u64,
    /// The loss terms.
    pub losses: Losses,
    /// Median over the rays of the mean pixel error of their segments.
    pub segment_error_in_pixels: f64,
    /// Samples at which all networks were evaluated.
    pub rendered_samples: usize,
    /// Matched pairs of local and global junctions.
    pub targets: usize,
    /// Learning rate of the networks.
    pub learning_rate: f64,
    /// Scale of the density.
    pub beta: f64,
}

/// Where the time of one iteration went, on the host's clock: a device that
/// computes later shows it where its results are read.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTimings {
    /// Rays and what was observed along them.
    pub batch: Duration,
    /// Where rays are sampled, with the network evaluations for it.
    pub sampler: Duration,
    /// Rendering and losses, without the assignment.
    pub forward: Duration,
    /// Local junctions and their assignment.
    pub assignment: Duration,
    /// Gradients.
    pub backward: Duration,
    /// The parameters' move.
    pub optimiser: Duration,
}

impl StepTimings {
    /// All parts together.
    pub fn total(&self) -> Duration {
        self.batch + self.sampler + self.forward + self.assignment + self.backward + self.optimiser
    }
}

impl std::ops::AddAssign for StepTimings {
    fn add_assign(&mut self, other: Self) {
        self.batch += other.batch;
        self.sampler += other.sampler;
        self.forward += other.forward;
        self.assignment += other.assignment;
        self.backward += other.backward;
        self.optimiser += other.optimiser;
    }
}

/// The state of an optimisation.
pub struct Trainer {
    data: TrainingData,
    surface_points: SurfacePoints,
    config: TrainingConfig,
    seed: u64,
    device: Device,
    scene_radius: f64,
    model: NeatModel,
    adam: Adam,
    sampling: SamplePlacement,
    iteration: u64,
    /// Factor on all learning rates: below 1 after a numerical failure.
    learning_rate_scale: f64,
    /// The loss, averaged over the last steps.
    average_loss: Option<f64>,
    /// β of the last iteration.
    beta: f64,
    timings: StepTimings,
    rows: StepRows,
}

/// Everything random or observed of one iteration.
struct Prepared {
    batch: Batch,
    samples: StepSamples,
    eikonal_points: Vec<[f32; 3]>,
    eikonal_samples: Option<Tensor<2>>,
    surface_points: Vec<[f32; 3]>,
    /// Distances that the sampler asked for.
    asked: usize,
}

impl Prepared {
    fn input<'a>(&'a self, views: &'a [JunctionView<'a>], junctions_due: bool) -> StepInput<'a> {
        StepInput {
            batch: &self.batch,
            samples: self.samples.placed(),
            eikonal_points: &self.eikonal_points,
            eikonal_samples: self.eikonal_samples.as_ref(),
            surface_points: &self.surface_points,
            views,
            junctions_due,
        }
    }
}

/// Loss and gradients of an iteration, before the parameters move.
#[derive(Clone, Debug)]
pub struct Probe {
    /// The loss terms.
    pub losses: Losses,
    /// Rendered colour, `[R · 3]`.
    pub color: Vec<f32>,
    /// Gradient of the total loss by parameter name.
    pub gradients: BTreeMap<String, TensorData>,
}

impl Trainer {
    /// Networks at their start and the scene prepared.
    ///
    /// # Errors
    /// If the configuration contradicts itself or the scene has no usable pixel.
    pub fn new(
        scene: &Scene,
        config: &TrainingConfig,
        seed: u64,
        device: &Device,
    ) -> Result<Self, TrainError> {
        config.validate()?;
        let data = TrainingData::new(scene, config);
        if data.region_pixels() == 0 {
            return Err(TrainError::NoRegionPixel(config.attraction_distance));
        }
        let scene_radius = config.scene_radius.unwrap_or(scene.sphere_radius);
        let device = device.clone().autodiff();
        let model = NeatModel::new(&config.model, scene_radius, seed, &device);
        let initial_radius = config.model.implicit.initial_sphere * scene_radius;
        let sampler = config.train.sampler.init(scene_radius, initial_radius);
        Ok(Self {
            sampling: SamplePlacement::new(&config.train, sampler, &device),
            data,
            surface_points: SurfacePoints::of(scene, scene_radius),
            adam: Adam::new(config.train.adam),
            beta: config.model.density.initial_beta,
            config: config.clone(),
            seed,
            device,
            scene_radius,
            model,
            iteration: 0,
            learning_rate_scale: 1.0,
            average_loss: None,
            timings: StepTimings::default(),
            rows: StepRows::default(),
        })
    }

    /// Goes on from a checkpoint of the same scene, configuration and seed.
    ///
    /// # Errors
    /// As [`Self::new`], and if the checkpoint does not fit.
    pub fn resume(
        scene: &Scene,
        config: &TrainingConfig,
        seed: u64,
        device: &Device,
        checkpoint: Checkpoint,
    ) -> Result<Self, TrainError> {
        let mut trainer = Self::new(scene, config, seed, device)?;
        trainer.iteration = metadata(&checkpoint, "iteration")?;
        trainer.beta = metadata(&checkpoint, "beta")?;
        trainer.learning_rate_scale = metadata(&checkpoint, LEARNING_RATE_SCALE)?;
        let average: f64 = metadata(&checkpoint, AVERAGE_LOSS)?;
        trainer.average_loss = average.is_finite().then_some(average);
        let mut parameters = BTreeMap::new();
        let mut moments: BTreeMap<String, [Option<TensorData>; 2]> = BTreeMap::new();
        for (name, data) in checkpoint.tensors {
            if let Some(name) = name.strip_prefix("model.") {
                parameters.insert(name.to_owned(), data);
            } else if let Some(name) = name.strip_prefix("adam.first.") {
                moments.entry(name.to_owned()).or_default()[0] = Some(data);
            } else if let Some(name) = name.strip_prefix("adam.second.") {
                moments.entry(name.to_owned()).or_default()[1] = Some(data);
            } else if name == "sampler.grid" {
                let values = data.convert::<f32>().try_into_vec_as::<f32>();
                if !values.is_ok_and(|values| trainer.sampling.restore(values)) {
                    return Err(TrainError::Checkpoint(name));
                }
            }
        }
        let mut state = BTreeMap::new();
        for (name, pair) in moments {
            match pair {
                [Some(first), Some(second)] => state.insert(name, [first, second]),
                _ => return Err(TrainError::Checkpoint(format!("adam.second.{name}"))),
            };
        }
        trainer.model = load_parameters(trainer.model, parameters, None)?;
        trainer.adam = Adam::restore(config.train.adam, trainer.iteration, state);
        Ok(trainer)
    }

    /// Factor on all learning rates of the configuration.
    pub fn learning_rate_scale(&self) -> f64 {
        self.learning_rate_scale
    }

    /// Multiplies all learning rates by `factor` from now on.
    pub fn scale_learning_rates(&mut self, factor: f64) {
        self.learning_rate_scale *= factor;
    }

    /// The loss, averaged over the last steps; infinite before the first one.
    pub fn average_loss(&self) -> f64 {
        self.average_loss.unwrap_or(f64::INFINITY)
    }

    /// Iterations done.
    pub fn iteration(&self) -> u64 {
        self.iteration
    }

    /// One iteration. `schedule` is the share of the run that is done, in [0, 1]:
    /// the learning rate and an annealed β follow it.
    ///
    /// # Errors
    /// If loss or gradient are no numbers; the parameters are then as before.
    pub fn step(&mut self, schedule: f64) -> Result<StepReport, TrainError> {
        // A device of its own has nothing to hand out.
        if !is_fused(&self.device) {
            return self.step_here(schedule);
        }
        with_awake_worker(|| self.step_here(schedule))
    }

    fn step_here(&mut self, schedule: f64) -> Result<StepReport, TrainError> {
        let StepGradients {
            losses,
            segment_errors,
            targets,
            mut gradients,
            finite,
            ..
        } = self.gradients(schedule)?;
        if !losses.total.is_finite() {
            return Err(TrainError::NonFiniteLoss {
                iteration: self.iteration + 1,
                value: losses.total,
            });
        }
        if !finite {
            return Err(TrainError::NonFiniteGradient {
                iteration: self.iteration + 1,
            });
        }
        let start = Instant::now();
        let train = &self.config.train;
        let factor =
            self.learning_rate_scale * learning_rate_factor(train, self.iteration, schedule);
        let networks = train.learning_rate * factor;
        let junctions = train.junction_learning_rate * factor;
        let rate = |name: &str| match name.starts_with("perceiver.") {
            true => junctions,
            false => networks,
        };
        let model = self.model.clone();
        self.model = self.adam.step(model, &mut gradients, rate);
        self.timings.optimiser = start.elapsed();
        self.iteration += 1;
        let average = self.average_loss.unwrap_or(losses.total);
        self.average_loss = Some(average + (losses.total - average) / AVERAGED_STEPS);
        Ok(StepReport {
            iteration: self.iteration,
            losses,
            segment_error_in_pixels: median(segment_errors),
            rendered_samples: self.rows.full,
            targets,
            learning_rate: networks,
            beta: self.beta,
        })
    }

    /// Loss, outputs and gradients of the next iteration, without moving the
    /// parameters: to compare backends.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn probe(&mut self, schedule: f64) -> Result<Probe, TrainError> {
        let loss = loop {
            let (loss, progress) = self.whole_loss(schedule)?;
            let Some(progress) = progress else {
                break loss;
            };
            let progress = host_vec(progress);
            if self.sampling.sufficed([progress[0], progress[1]]) {
                break loss;
            }
        };
        let losses = loss.losses();
        let color = host_vec(loss.color.clone());
        let mut gradients = GradientsParams::from_grads(loss.total.backward(), &self.model);
        Ok(Probe {
            losses,
            color,
            gradients: neat_tensor::parameters::named_gradients(&self.model, &mut gradients),
        })
    }

    /// Losses and gradients of the next iteration.
    fn gradients(&mut self, schedule: f64) -> Result<StepGradients, TrainError> {
        let chunk = self.config.train.ray_chunk;
        let Some(chunk) = chunk.filter(|chunk| *chunk < self.config.train.rays) else {
            return self.whole_gradients(schedule);
        };
        let (prepared, start) = (self.prepare(schedule)?, Instant::now());
        let views = self.junction_views();
        let input = prepared.input(&views, self.junctions_due());
        let result = chunked_step(
            &self.model,
            &input,
            || self.beta_tensor(schedule),
            &self.config.train,
            &self.device,
            chunk,
        );
        let step = result.map_err(|source| self.unmatched(source))?;
        self.rows = StepRows {
            sampler: prepared.asked,
            ..step.rows
        };
        self.timings.assignment = step.assignment;
        self.timings.backward = step.backward;
        self.timings.forward = start.elapsed() - step.assignment - step.backward;
        Ok(step)
    }

    /// Losses and gradients of the next iteration, all rays at once.
    fn whole_gradients(&mut self, schedule: f64) -> Result<StepGradients, TrainError> {
        loop {
            let (loss, progress) = self.whole_loss(schedule)?;
            let start = Instant::now();
            let gradients = GradientsParams::from_grads(loss.total.backward(), &self.model);
            let check = GradientCheck::of(&self.model, &gradients);
            // Of a device, everything is read at once when the step is over.
            let beta = (self.is_beta_unknown()).then(|| self.beta_tensor(schedule).inner());
            let parts = [Some(loss.terms.inner()), beta, progress, check.on_device];
            let lengths = parts.each_ref().map(|part| match part {
                Some(part) => part.dims()[0],
                None => 0,
            });
            let report = host_vec(Tensor::cat(parts.into_iter().flatten().collect(), 0));
            let mut rest = report.as_slice();
            let [terms, beta, progress, sum] = lengths.map(|length| {
                let (part, others) = rest.split_at(length);
                rest = others;
                part
            });
            if let [needed, more_wanted] = *progress
                && !self.sampling.sufficed([needed, more_wanted])
            {
                continue;
            }
            if let [beta] = *beta {
                self.beta = f64::from(beta);
            }
            self.timings.backward = start.elapsed();
            return Ok(StepGradients {
                losses: Losses::from_terms(terms),
                segment_errors: loss.segment_errors,
                rows: self.rows,
                targets: loss.targets,
                assignment: loss.assignment,
                backward: self.timings.backward,
                gradients,
                finite: check.on_host && sum.iter().all(|sum| sum.is_finite()),
            });
        }
    }

    /// Whether β is learned and only the device knows it.
    fn is_beta_unknown(&self) -> bool {
        let learned = self.config.model.density.schedule == BetaSchedule::Learned;
        learned && self.sampling.is_on_device()
    }

    /// The loss of the next iteration, all rays at once, and how far Algorithm 1
    /// came if nobody knows yet whether that was enough.
    fn whole_loss(&mut self, schedule: f64) -> Result<(StepLoss, Option<Tensor<1>>), TrainError> {
        let (prepared, start) = (self.prepare(schedule)?, Instant::now());
        let views = self.junction_views();
        let input = prepared.input(&views, self.junctions_due());
        let beta = self.beta_tensor(schedule);
        let result = step_loss(&self.model, &input, beta, &self.config.train, &self.device);
        let loss = result.map_err(|source| self.unmatched(source))?;
        self.rows = StepRows {
            sampler: prepared.asked,
            ..loss.rows
        };
        self.timings.assignment = loss.assignment;
        self.timings.forward = start.elapsed() - loss.assignment;
        Ok((loss, prepared.samples.progress()))
    }

    fn unmatched(&self, source: AssignmentError) -> TrainError {
        TrainError::Assignment {
            iteration: self.iteration + 1,
            source,
        }
    }

    fn junctions_due(&self) -> bool {
        let interval = self.config.train.junction_interval.max(1);
        (self.iteration + 1).is_multiple_of(interval)
    }

    fn junction_views(&self) -> Vec<JunctionView<'_>> {
        let views = self.data.views.iter();
        views
            .map(|view| JunctionView {
                camera: &view.camera,
                junctions_in_image: &view.junctions,
            })
            .collect()
    }

    /// Scale of the density in the next iteration.
    fn beta_tensor(&self, schedule: f64) -> Tensor<1> {
        let density = &self.config.model.density;
        match density.schedule {
            BetaSchedule::Learned => self.model.density.beta(),
            BetaSchedule::Annealed => {
                Tensor::from_data([density.annealed_beta(schedule) as f32], &self.device)
            }
        }
    }

    /// Draws and places everything random of the next iteration.
    fn prepare(&mut self, schedule: f64) -> Result<Prepared, TrainError> {
        let density = &self.config.model.density;
        match density.schedule {
            BetaSchedule::Annealed => {
                self.beta = f64::from(density.annealed_beta(schedule) as f32);
            }
            BetaSchedule::Learned if self.sampling.is_on_device() => {}
            BetaSchedule::Learned => {
                self.beta = f64::from(host_vec(self.beta_tensor(schedule))[0]);
            }
        }
        let start = Instant::now();
        let batch = (self.data).batch(&self.config.train, self.seed, self.iteration)?;
        self.timings.batch = start.elapsed();
        let start = Instant::now();
        let to_sample = StepToSample {
            seed: self.seed,
            iteration: self.iteration,
            rays: &batch.rays,
            beta: self.beta,
            #[cfg(feature = "wgpu")]
            beta_tensor: (self.sampling.is_on_device()).then(|| self.beta_tensor(schedule)),
            network: &self.model.implicit_network,
        };
        let (samples, asked) = self.sampling.place(&to_sample, &self.device);
        self.timings.sampler = start.elapsed();
        let (eikonal_points, eikonal_samples) = self.eikonal_points(&batch, &samples);
        let train = &self.config.train;
        let wanted = match train.loss.points > 0.0 {
            true => train.surface_points,
            false => 0,
        };
        Ok(Prepared {
            batch,
            samples,
            eikonal_points,
            eikonal_samples,
            surface_points: (self.surface_points).draw(wanted, self.seed, self.iteration),
            asked,
        })
    }

    /// The signed distance network as it is now.
    pub fn implicit_network(&self) -> &ImplicitNetwork {
        &self.model.implicit_network
    }

    /// Where the time of the last iteration went.
    pub fn timings(&self) -> StepTimings {
        self.timings
    }

    /// What went through the networks in the last iteration.
    pub fn rows(&self) -> StepRows {
        self.rows
    }

    /// The points of the eikonal term besides rendered samples: those that the host
    /// knows, and those that only the device knows.
    fn eikonal_points(
        &self,
        batch: &Batch,
        samples: &StepSamples,
    ) -> (Vec<[f32; 3]>, Option<Tensor<2>>) {
        let config = &self.config.train.eikonal;
        let mut rng = stream(self.seed, Purpose::Eikonal, self.iteration);
        let radius = self.scene_radius as f32;
        let count = config.uniform_points.unwrap_or(batch.rays.len());
        let mut points: Vec<[f32; 3]> = (0..count)
            .map(|_| std::array::from_fn(|_| (rng.random::<f32>() * 2.0 - 1.0) * radius))
            .collect();
        if !config.one_sample_per_ray {
            return (points, None);
        }
        let per_ray = samples.placed().per_ray();
        let picks: Vec<usize> = (0..batch.rays.len())
            .map(|_| rng.random_range(0..per_ray))
            .collect();
        let (picked, on_device) = samples.pick(&batch.rays, &picks);
        points.extend(picked);
        (points, on_device)
    }

    /// Everything that [`Self::resume`] needs.
    pub fn checkpoint(&self) -> Checkpoint {
        let mut checkpoint = Checkpoint::default();
        for (name, data) in named_parameters(&self.model) {
            checkpoint.tensors.insert(format!("model.{name}"), data);
        }
        for (name, [first, second]) in self.adam.state() {
            checkpoint
                .tensors
                .insert(format!("adam.first.{name}"), first);
            checkpoint
                .tensors
                .insert(format!("adam.second.{name}"), second);
        }
        if let Some(grid) = self.sampling.sampler().state() {
            let len = grid.len();
            checkpoint.tensors.insert(
                "sampler.grid".to_owned(),
                TensorData::new(grid.to_vec(), [len]),
            );
        }
        let metadata = [
            ("iteration", self.iteration.to_string()),
            ("seed", self.seed.to_string()),
            ("scene_radius", self.scene_radius.to_string()),
            ("beta", self.beta.to_string()),
            (LEARNING_RATE_SCALE, self.learning_rate_scale.to_string()),
            (AVERAGE_LOSS, self.average_loss().to_string()),
        ];
        checkpoint
            .metadata
            .extend(metadata.map(|(key, value)| (key.to_owned(), value)));
        checkpoint
    }

    /// Where the global junctions are now, in the world.
    pub fn junctions(&self) -> Vec<[f32; 3]> {
        host_points(self.model.perceiver.junctions().inner())
    }

    /// The field as it is now, for rendering and distillation.
    pub fn field(&self) -> TrainedField {
        TrainedField::new(
            self.model.valid(),
            self.sampling.sampler(),
            self.beta as f32,
            self.scene_radius,
            self.config.train.min_sample_weight,
            self.device.clone().inner(),
        )
    }
}

/// Factor on the learning rates in iteration `iteration` (counted from 0), when
/// the share `schedule` of the run is done: warm-up times exponential decay.
pub fn learning_rate_factor(train: &TrainConfig, iteration: u64, schedule: f64) -> f64 {
    let warm_up = match train.warm_up_steps {
        0 => 1.0,
        steps => ((iteration + 1) as f64 / steps as f64).min(1.0),
    };
    warm_up * train.learning_rate_decay.powf(schedule)
}

fn median(mut values: Vec<f32>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_unstable_by(f32::total_cmp);
    f64::from(values[values.len() / 2])
}
