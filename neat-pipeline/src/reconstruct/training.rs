//! The training loop: budget, checkpoints, metrics, cancellation, and what is done
//! about numbers and devices that fail.

use super::RunOptions;
use super::device_failure::{self, Replacement};
use super::session::Session;
use crate::changes::Belonging;
use crate::error::PipelineError;
use crate::event::{Event, Stage, WarningKind, timed};
use crate::manifest::Manifest;
use crate::run_dir::{Existing, RunDir};
use nalgebra::Vector3;
use neat_tensor::backend::is_on_host;
use neat_tensor::checkpoint::Checkpoint;
use neat_tensor::{Backend, Kernels};
use neat_train::Trainer;
use neat_train::step_log::{JunctionsLine, StepLog};
use neat_train::{OrientedPoint, TrainedField};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// One line of `metrics.jsonl` per so many steps.
const METRICS_INTERVAL: u64 = 10;
/// The junctions are logged so many times over the training.
const JUNCTION_SNAPSHOTS: f64 = 50.0;

/// How much of the training is done: by steps or by time, whichever is ahead.
struct Schedule {
    steps: u64,
    budget: Option<Duration>,
    /// Time of earlier sessions of the run.
    before: Duration,
    start: Instant,
}

impl Schedule {
    fn elapsed(&self) -> Duration {
        self.before + self.start.elapsed()
    }

    /// From 0 to 1.
    fn fraction(&self, iteration: u64) -> f64 {
        let by_steps = iteration as f64 / self.steps.max(1) as f64;
        let by_time = self.budget.map_or(0.0, |budget| {
            self.elapsed().as_secs_f64() / budget.as_secs_f64()
        });
        by_steps.max(by_time).min(1.0)
    }
}

/// A numerical failure lowers the learning rates by this factor …
const LOWER_RATE: f64 = 0.3;
/// … at most so often from one checkpoint.
const MAX_TRIES: usize = 3;

impl Session<'_> {
    /// Trains until the steps or the time are used up, or `cancelled` is set. Goes on
    /// from the last checkpoint, where there is one.
    pub fn train(
        &mut self,
        options: &RunOptions,
        cancelled: &AtomicBool,
    ) -> Result<TrainedField, PipelineError> {
        if self.plan.config().train.dense_points {
            self.match_photographs(cancelled)?;
        }
        (self.on_event)(Event::StageStarted(Stage::Train));
        let field = loop {
            // Only a GPU fails by itself; a panic on the CPU is our mistake.
            if is_on_host(&self.device) {
                break self.train_here(options, cancelled)?;
            }
            match device_failure::catch(|| self.train_here(options, cancelled)) {
                Ok(result) => break result?,
                Err(reason) => self.replace_device(&reason, options)?,
            }
        };
        let seconds = self.earlier_training_time().as_secs_f64();
        let stage = Stage::Train;
        (self.on_event)(Event::StageFinished { stage, seconds });
        Ok(field)
    }

    /// Finds points on surfaces by matching the photographs. A run that goes on finds the
    /// same ones again.
    fn match_photographs(&mut self, cancelled: &AtomicBool) -> Result<(), PipelineError> {
        let radius = self.plan.config().data.scene_radius;
        let radius = radius.unwrap_or(self.scene.sphere_radius);
        let (scene, manifest, on_event) = (&self.scene, &mut self.manifest, &mut self.on_event);
        let tell = &mut |event: Event<'_>| {
            manifest.record(&event);
            on_event(event);
        };
        let stage = Stage::Match;
        let points = timed(tell, stage, |tell| {
            neat_stereo::match_views(scene, radius, &mut |fraction| {
                tell(Event::StageProgress { stage, fraction });
                match cancelled.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            })
        })?;
        let (found, views) = (points.len(), scene.views.len());
        tell(Event::Note(format!(
            "{found} points on surfaces by matching {views} views"
        )));
        self.dense_points = (points.iter())
            .map(|point| OrientedPoint {
                position: point.position_in_world.map(|x| x as f32).into(),
                normal: point.normal_in_world.map(|x| x as f32).into(),
            })
            .collect();
        Ok(())
    }

    /// Trains on the device of the session; after a numerical failure with lower
    /// learning rates from the last checkpoint.
    fn train_here(
        &mut self,
        options: &RunOptions,
        cancelled: &AtomicBool,
    ) -> Result<TrainedField, PipelineError> {
        let schedule = Schedule {
            steps: self.plan.config().train.steps,
            budget: options.time_budget,
            before: self.earlier_training_time(),
            start: Instant::now(),
        };
        let mut tries = 0;
        let mut tried_from = 0;
        loop {
            let mut trainer = self.trainer(options)?;
            let from = trainer.iteration();
            // A kill may have come between the checkpoint and the manifest that tells
            // of it.
            self.manifest.steps = from;
            if from > 0 {
                let steps = schedule.steps;
                (self.on_event)(Event::Resumed { step: from, steps });
            }
            // Another checkpoint has been reached since the last failure, and holds
            // the rates that led there.
            if from != tried_from {
                (tries, tried_from) = (0, from);
            }
            trainer.scale_learning_rates(LOWER_RATE.powi(tries as i32));
            let failure = match self.optimise(&mut trainer, &schedule, cancelled) {
                Ok(()) => return Ok(trainer.field()),
                Err(PipelineError::Train(failure)) if failure.is_numerical() => failure,
                Err(error) => return Err(error),
            };
            if tries == MAX_TRIES {
                return Err(PipelineError::Diverged {
                    tries,
                    dump: self.dump(&trainer)?,
                    source: Box::new(failure),
                });
            }
            tries += 1;
            let from = self.dir.usable_checkpoint()?;
            let from = from.map_or("the beginning".to_owned(), |usable| {
                let name = usable.path.file_name().unwrap_or_default();
                name.to_string_lossy().into_owned()
            });
            let text = format!(
                "{failure}: training goes on from {from} with {LOWER_RATE} of the learning rates"
            );
            self.warn(WarningKind::Divergence, text);
        }
    }

    /// Steps until the steps or the time are used up.
    fn optimise(
        &mut self,
        trainer: &mut Trainer,
        schedule: &Schedule,
        cancelled: &AtomicBool,
    ) -> Result<(), PipelineError> {
        let mut metrics = StepLog::open(&self.dir.metrics(), trainer.iteration())?;
        let mut junctions = StepLog::open(&self.dir.junctions(), trainer.iteration())?;
        let mut fraction = schedule.fraction(trainer.iteration());
        let mut snapshots = if trainer.iteration() == 0 {
            0.0
        } else {
            (fraction * JUNCTION_SNAPSHOTS).floor() + 1.0
        };
        let interval = self.plan.config().train.checkpoint_interval;
        let mut saved = Instant::now();
        while fraction < 1.0 {
            if cancelled.load(Ordering::Relaxed) {
                metrics.sync()?;
                junctions.sync()?;
                let checkpoint = self.save(trainer, schedule)?;
                return Err(PipelineError::Interrupted {
                    step: trainer.iteration(),
                    checkpoint,
                });
            }
            let report = trainer.step(fraction)?;
            let iteration = trainer.iteration();
            fraction = schedule.fraction(iteration);
            (self.on_event)(Event::Step {
                report: &report,
                fraction,
            });
            if iteration == 1 || fraction >= 1.0 || iteration.is_multiple_of(METRICS_INTERVAL) {
                metrics.append(&report)?;
            }
            if fraction * JUNCTION_SNAPSHOTS >= snapshots {
                junctions.append(&self.junctions_line(trainer))?;
                snapshots = (fraction * JUNCTION_SNAPSHOTS).floor() + 1.0;
            }
            let late = saved.elapsed().as_secs_f64() > self.plan.config().train.checkpoint_seconds;
            if fraction >= 1.0 || late || iteration.is_multiple_of(interval) {
                // A checkpoint never knows more than the logs beside it.
                metrics.sync()?;
                junctions.sync()?;
                self.save(trainer, schedule)?;
                saved = Instant::now();
            }
        }
        Ok(())
    }

    /// A trainer that continues from the last checkpoint, or a new one.
    fn trainer(&self, options: &RunOptions) -> Result<Trainer, PipelineError> {
        let kernels = Kernels::within(options.memory_limit.bytes());
        let mut config = self.plan.config().training(kernels);
        if let Some(chunk) = self.ray_chunk {
            config.train.ray_chunk = Some(chunk);
        }
        let (scene, device, seed) = (&self.scene, &self.device, options.seed);
        let trainer = match self.dir.usable_checkpoint()? {
            Some(usable) => Trainer::resume(scene, &config, seed, device, usable.checkpoint)?,
            None => Trainer::new(scene, &config, seed, device)?,
        };
        Ok(trainer.with_oriented_points(&self.dense_points))
    }

    /// Takes less memory, or another device, after the device has failed.
    fn replace_device(&mut self, reason: &str, options: &RunOptions) -> Result<(), PipelineError> {
        let train = &self.plan.config().train;
        let chunk = self.ray_chunk.or(train.ray_chunk).unwrap_or(train.rays);
        // Who asked for one backend by name gets that one or none.
        let cpu_allowed = options.backend == Backend::Auto;
        let what = match Replacement::after(chunk, train.rays, cpu_allowed) {
            Replacement::SmallerChunks(smaller) => {
                self.ray_chunk = Some(smaller);
                format!("{smaller} rays at once")
            }
            Replacement::Cpu => {
                self.device = Backend::Flex.device()?;
                self.ray_chunk = None;
                self.manifest.backend = Backend::Flex.to_string();
                self.manifest.device = "CPU".to_owned();
                self.manifest.decisions.retain(|d| d.setting != "backend");
                "the CPU".to_owned()
            }
            Replacement::None => {
                let reason = reason.to_owned();
                return Err(PipelineError::DeviceFailed { reason });
            }
        };
        let text = format!(
            "the device failed ({reason}): training goes on from the last checkpoint with {what}"
        );
        self.warn(WarningKind::DeviceFailure, text);
        Ok(())
    }

    /// Leaves the folder of a run whose next step fails as this one's did.
    fn dump(&self, trainer: &Trainer) -> Result<PathBuf, PipelineError> {
        let path = self.dir.failure();
        let (dump, _lock) = RunDir::create(&path, Existing::Overwrite)?;
        dump.write_config(self.plan.config())?;
        dump.write_plan(&self.plan)?;
        dump.write_checkpoint(trainer.iteration(), &self.checkpoint(trainer)?, 1)?;
        dump.write_manifest(&Manifest {
            steps: trainer.iteration(),
            ..self.manifest.clone()
        })?;
        Ok(path)
    }

    /// The global junctions, in the frame of the user's files.
    fn junctions_line(&self, trainer: &Trainer) -> JunctionsLine {
        let original = |point: [f32; 3]| {
            let in_world = Vector3::from(point).map(f64::from);
            let in_original = self.scene.original_from_world.apply(&in_world);
            in_original.map(|x| x as f32).into()
        };
        JunctionsLine {
            iteration: trainer.iteration(),
            junctions: trainer.junctions().into_iter().map(original).collect(),
        }
    }

    fn earlier_training_time(&self) -> Duration {
        let seconds = self.manifest.seconds.get(&Stage::Train);
        // The manifest is a file that anybody may have changed.
        Duration::try_from_secs_f64(*seconds.unwrap_or(&0.0)).unwrap_or_default()
    }

    /// The trainer's state, with what it belongs to.
    fn checkpoint(&self, trainer: &Trainer) -> Result<Checkpoint, PipelineError> {
        let mut checkpoint = trainer.checkpoint();
        let of = Belonging::new(self.plan.config(), &self.manifest)?;
        of.write_into(&mut checkpoint.metadata);
        Ok(checkpoint)
    }

    /// Writes a checkpoint, and the manifest that says how far the run is.
    fn save(&mut self, trainer: &Trainer, schedule: &Schedule) -> Result<PathBuf, PipelineError> {
        let checkpoint = self.checkpoint(trainer)?;
        let kept = self.plan.config().train.kept_checkpoints;
        let path = (self.dir).write_checkpoint(trainer.iteration(), &checkpoint, kept)?;
        tracing::debug!(step = trainer.iteration(), path = %path.display(), "checkpoint");
        self.manifest.steps = trainer.iteration();
        let seconds = schedule.elapsed().as_secs_f64();
        self.manifest.seconds.insert(Stage::Train, seconds);
        self.write_manifest()?;
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(budget: Option<f64>, before: f64) -> Schedule {
        Schedule {
            steps: 100,
            budget: budget.map(Duration::from_secs_f64),
            before: Duration::from_secs_f64(before),
            start: Instant::now(),
        }
    }

    #[test]
    fn the_faster_of_steps_and_time_counts() {
        assert_eq!(schedule(None, 1e6).fraction(25), 0.25);
        assert_eq!(schedule(Some(1e9), 0.0).fraction(100), 1.0);
        let by_time = schedule(Some(1e6), 5e5).fraction(25);
        assert!((by_time - 0.5).abs() < 1e-3, "{by_time}");
        // More steps than asked for, as after --resume with fewer.
        assert_eq!(schedule(None, 0.0).fraction(300), 1.0);
    }
}
