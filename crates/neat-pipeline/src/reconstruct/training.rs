//! The training loop: budget, checkpoints, metrics and cancellation.

use super::RunOptions;
use super::session::Session;
use crate::error::PipelineError;
use crate::event::{Event, Stage};
use crate::field::TrainedField;
use crate::run_dir::Existing;
use crate::step_log::{JunctionsLine, StepLog};
use crate::trainer::Trainer;
use nalgebra::Vector3;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// One line of `metrics.jsonl` per so many steps.
const METRICS_INTERVAL: u64 = 10;
/// The junctions are logged so many times over the training.
const JUNCTION_SNAPSHOTS: f64 = 50.0;

/// How much of the training is done: by steps or by time, whichever is ahead.
struct Progress {
    steps: u64,
    budget: Option<Duration>,
    /// Time of earlier sessions of the run.
    before: Duration,
    start: Instant,
}

impl Progress {
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

impl Session<'_> {
    /// Trains until the steps or the time are used up, or `cancelled` is set.
    pub fn train(
        &mut self,
        options: &RunOptions,
        cancelled: &AtomicBool,
    ) -> Result<TrainedField, PipelineError> {
        (self.on_event)(Event::StageStarted(Stage::Train));
        let mut trainer = self.trainer(options)?;
        let progress = Progress {
            steps: self.config.train.steps,
            budget: options.time_budget,
            before: self.earlier_training_time(),
            start: Instant::now(),
        };
        let mut metrics = StepLog::open(&self.dir.metrics(), trainer.iteration())?;
        let mut junctions = StepLog::open(&self.dir.junctions(), trainer.iteration())?;
        let mut fraction = progress.fraction(trainer.iteration());
        let mut snapshots = match trainer.iteration() {
            0 => 0.0,
            _ => (fraction * JUNCTION_SNAPSHOTS).floor() + 1.0,
        };
        while fraction < 1.0 {
            if cancelled.load(Ordering::Relaxed) {
                let checkpoint = self.save(&trainer, &progress)?;
                return Err(PipelineError::Interrupted {
                    step: trainer.iteration(),
                    checkpoint,
                });
            }
            let report = trainer.step(fraction)?;
            let iteration = trainer.iteration();
            fraction = progress.fraction(iteration);
            (self.on_event)(Event::Step {
                report: &report,
                fraction,
            });
            if iteration == 1 || fraction >= 1.0 || iteration.is_multiple_of(METRICS_INTERVAL) {
                metrics.append(&report)?;
            }
            if fraction * JUNCTION_SNAPSHOTS >= snapshots {
                junctions.append(&self.junctions_line(&trainer))?;
                snapshots = (fraction * JUNCTION_SNAPSHOTS).floor() + 1.0;
            }
            let interval = self.config.train.checkpoint_interval.max(1);
            if fraction >= 1.0 || iteration.is_multiple_of(interval) {
                self.save(&trainer, &progress)?;
            }
        }
        (self.on_event)(Event::StageFinished {
            stage: Stage::Train,
            seconds: progress.elapsed().as_secs_f64(),
        });
        Ok(trainer.field())
    }

    /// A new trainer, or one that continues from the last checkpoint.
    fn trainer(&self, options: &RunOptions) -> Result<Trainer, PipelineError> {
        let (scene, config, device) = (&self.scene, &self.config, &self.device);
        let seed = options.seed;
        Ok(match options.existing {
            Existing::Resume => {
                let checkpoint = self.dir.read_latest_checkpoint()?;
                Trainer::resume(scene, config, seed, device, checkpoint)?
            }
            Existing::Refuse | Existing::Overwrite => Trainer::new(scene, config, seed, device)?,
        })
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

    /// Writes a checkpoint, and the manifest that says how far the run is.
    fn save(&mut self, trainer: &Trainer, progress: &Progress) -> Result<PathBuf, PipelineError> {
        let checkpoint = self
            .dir
            .write_checkpoint(trainer.iteration(), &trainer.checkpoint())?;
        self.manifest.steps = trainer.iteration();
        let seconds = progress.elapsed().as_secs_f64();
        self.manifest.seconds.insert(Stage::Train, seconds);
        self.write_manifest()?;
        Ok(checkpoint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(budget: Option<f64>, before: f64) -> Progress {
        Progress {
            steps: 100,
            budget: budget.map(Duration::from_secs_f64),
            before: Duration::from_secs_f64(before),
            start: Instant::now(),
        }
    }

    #[test]
    fn the_faster_of_steps_and_time_counts() {
        assert_eq!(progress(None, 1e6).fraction(25), 0.25);
        assert_eq!(progress(Some(1e9), 0.0).fraction(100), 1.0);
        let by_time = progress(Some(1e6), 5e5).fraction(25);
        assert!((by_time - 0.5).abs() < 1e-3, "{by_time}");
        // More steps than asked for, as after --resume with fewer.
        assert_eq!(progress(None, 0.0).fraction(300), 1.0);
    }
}
