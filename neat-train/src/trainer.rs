//! The optimisation of one scene.

use crate::awake::with_awake_worker;
use crate::checkpoint_metadata::{AVERAGE_LOSS, LEARNING_RATE_SCALE, metadata};
use crate::config::TrainingConfig;
use crate::error::TrainError;
use crate::field::TrainedField;
use crate::flops::StepRows;
use crate::losses::Losses;
use crate::model::NeatModel;
use crate::step::{Step, StepExecutor, StepOutcome, StepTimings};
use crate::surface_points::{OrientedPoint, SurfacePoints};
use crate::training_data::TrainingData;
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use neat_core::Scene;
use neat_gjp::candidates::JunctionView;
use neat_sdf::ImplicitNetwork;
use neat_tensor::adam::Adam;
use neat_tensor::backend::is_on_host;
use neat_tensor::checkpoint::Checkpoint;
use neat_tensor::host::{host_points, host_vec};
use neat_tensor::parameters::{load_parameters, named_gradients, named_parameters};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;

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
    executor: StepExecutor,
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
        let kernels = &config.kernels;
        let model = NeatModel::new(&config.model, scene_radius, seed, &device)?;
        let model = model.with_kernels(kernels.clone());
        let initial_radius = config.model.implicit.initial_sphere * scene_radius;
        let sampler = config.train.sampler.init(scene_radius, initial_radius);
        Ok(Self {
            executor: StepExecutor::new(&config.train, sampler, kernels, &device),
            data,
            surface_points: SurfacePoints::of(scene, scene_radius),
            adam: Adam::new(config.train.adam).with_kernels(kernels.clone()),
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
                if !values.is_ok_and(|values| trainer.executor.restore(values)) {
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
        let adam = Adam::restore(config.train.adam, trainer.iteration, state);
        trainer.adam = adam.with_kernels(config.kernels.clone());
        Ok(trainer)
    }

    /// With more points on surfaces than the sparse ones of the scene, such as whoever runs
    /// the trainer finds where [`TrainConfig::dense_points`] asks for them.
    ///
    /// [`TrainConfig::dense_points`]: crate::config::TrainConfig::dense_points
    pub fn with_oriented_points(mut self, points: &[OrientedPoint]) -> Self {
        self.surface_points.extend(points, self.scene_radius);
        self
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
        if !is_on_host(&self.device) {
            return self.step_here(schedule);
        }
        with_awake_worker(|| self.step_here(schedule))
    }

    fn step_here(&mut self, schedule: f64) -> Result<StepReport, TrainError> {
        let mut outcome = self.gradients(schedule)?;
        let losses = outcome.losses;
        if !losses.total.is_finite() {
            return Err(TrainError::NonFiniteLoss {
                iteration: self.iteration + 1,
                value: losses.total,
            });
        }
        if !outcome.finite {
            return Err(TrainError::NonFiniteGradient {
                iteration: self.iteration + 1,
            });
        }
        let start = Instant::now();
        let train = &self.config.train;
        let factor = train.learning_rate_factor(self.iteration, schedule);
        let factor = self.learning_rate_scale * factor;
        let networks = train.learning_rate * factor;
        let junctions = train.junction_learning_rate * factor;
        let rate = |name: &str| {
            if name.starts_with("perceiver.") {
                junctions
            } else if name.ends_with("grid.table") {
                networks * train.grid_learning_rate
            } else {
                networks
            }
        };
        let model = self.model.clone();
        self.model = self.adam.step(model, &mut outcome.gradients, rate);
        self.timings.optimiser = start.elapsed();
        self.iteration += 1;
        let average = self.average_loss.unwrap_or(losses.total);
        self.average_loss = Some(average + (losses.total - average) / AVERAGED_STEPS);
        tracing::debug!(
            iteration = self.iteration,
            loss = losses.total,
            targets = outcome.targets,
            milliseconds = self.timings.total().as_millis() as u64,
            timings = ?self.timings,
            "step"
        );
        Ok(StepReport {
            iteration: self.iteration,
            losses,
            segment_error_in_pixels: median(outcome.segment_errors),
            rendered_samples: self.rows.full,
            targets: outcome.targets,
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
        let mut outcome = self.gradients(schedule)?;
        Ok(Probe {
            losses: outcome.losses,
            color: host_vec(Tensor::cat(outcome.color, 0)),
            gradients: named_gradients(&self.model, &mut outcome.gradients),
        })
    }

    /// Losses and gradients of the next iteration.
    fn gradients(&mut self, schedule: f64) -> Result<StepOutcome, TrainError> {
        let start = Instant::now();
        let (train, model) = (&self.config.train, &self.config.model);
        let batch = self.data.batch(train, self.seed, self.iteration)?;
        let batch_time = start.elapsed();
        let views = self.data.views.iter().map(|view| JunctionView {
            camera: &view.camera,
            junctions_in_image: &view.junctions,
        });
        let views: Vec<JunctionView<'_>> = views.collect();
        // Without a weight there is no such term.
        let points = if train.loss.points > 0.0 {
            train.surface_points
        } else {
            0
        };
        let step = Step {
            model: &self.model,
            train,
            density: &model.density,
            batch: &batch,
            views: &views,
            surface_points: &self.surface_points.draw(
                points,
                train.surface_point_reach,
                self.seed,
                self.iteration,
            ),
            seed: self.seed,
            iteration: self.iteration,
            schedule,
            scene_radius: self.scene_radius,
        };
        let outcome = self.executor.run(&step);
        let outcome = outcome.map_err(|source| TrainError::Assignment {
            iteration: self.iteration + 1,
            source,
        })?;
        self.beta = outcome.beta.map_or(self.beta, f64::from);
        self.rows = outcome.rows;
        self.timings = StepTimings {
            batch: batch_time,
            ..outcome.timings
        };
        Ok(outcome)
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
        if let Some(grid) = self.executor.sampler().state() {
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
            self.executor.sampler(),
            self.beta as f32,
            self.scene_radius,
            self.config.train.min_sample_weight,
            self.device.clone().inner(),
        )
    }
}

fn median(mut values: Vec<f32>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_unstable_by(f32::total_cmp);
    f64::from(values[values.len() / 2])
}
