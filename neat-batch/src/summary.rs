//! What has become of all jobs of a batch.

use crate::batch::Batch;
use crate::error::BatchError;
use crate::job::Job;
use crate::job_folder::JobFolder;
use crate::job_record::JobState;
use crate::result_files::{ResultFigures, read_result, read_state};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What has become of all jobs of a batch, by the files in OUT: whoever ran them,
/// in whatever shards.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// All of them together.
    pub totals: Totals,
    /// Each of them, in the order of the batch.
    pub jobs: Vec<JobSummary>,
}

/// What has become of one job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JobSummary {
    /// Its name.
    pub name: String,
    /// Folder of its scene.
    pub scene: PathBuf,
    /// What has become of it. A job whose process was killed is
    /// [`JobState::Interrupted`].
    pub state: JobState,
    /// How often a batch tried it; 0 also for a run by `neat reconstruct` itself.
    pub attempts: usize,
    /// How long that took together, in seconds.
    pub seconds: f64,
    /// Why it is not finished, if it failed, or why it has no `figures`.
    pub error: Option<String>,
    /// Its result, if it is finished.
    pub figures: Option<ResultFigures>,
}

/// What has become of all jobs together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// How many jobs nobody has begun with.
    pub pending: usize,
    /// How many are being worked on.
    pub running: usize,
    /// How many were stopped, or their process was killed.
    pub interrupted: usize,
    /// How many failed.
    pub failed: usize,
    /// How many are finished.
    pub finished: usize,
    /// The time of all attempts at all jobs, in seconds.
    pub seconds: f64,
    /// The means over the finished jobs.
    pub means: Aggregate,
    /// The medians over the finished jobs; of an even number, the mean of the two in
    /// the middle.
    pub medians: Aggregate,
}

/// One number for each figure; `None` where no finished job has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Aggregate {
    /// Time of all attempts, in seconds.
    pub seconds: Option<f64>,
    /// Number of junctions.
    pub junctions: Option<f64>,
    /// Number of edges.
    pub edges: Option<f64>,
    /// Share of the length of all 2D segments that edges explain.
    pub explained_length_share: Option<f64>,
    /// Distance of explained 2D segments from their edges, in pixels.
    pub mean_reprojection_error_in_pixels: Option<f64>,
    /// Precision of the junctions at the smallest threshold of `neat-abc`, 0.01.
    pub junction_precision: Option<f64>,
    /// Recall of the junctions there.
    pub junction_recall: Option<f64>,
    /// Precision of the segments there, by the larger end distance.
    pub segment_precision: Option<f64>,
    /// Recall of the segments there.
    pub segment_recall: Option<f64>,
}

impl Totals {
    /// How many jobs are in this state.
    pub fn count(&self, state: JobState) -> usize {
        match state {
            JobState::Pending => self.pending,
            JobState::Running => self.running,
            JobState::Interrupted => self.interrupted,
            JobState::Failed => self.failed,
            JobState::Finished => self.finished,
        }
    }

    fn of(jobs: &[JobSummary]) -> Self {
        let count = |state| jobs.iter().filter(|job| job.state == state).count();
        let finished: Vec<Aggregate> = jobs
            .iter()
            .filter(|job| job.state == JobState::Finished)
            .map(JobSummary::row)
            .collect();
        Self {
            pending: count(JobState::Pending),
            running: count(JobState::Running),
            interrupted: count(JobState::Interrupted),
            failed: count(JobState::Failed),
            finished: count(JobState::Finished),
            seconds: jobs.iter().map(|job| job.seconds).sum(),
            means: Aggregate::of(&finished, mean),
            medians: Aggregate::of(&finished, median),
        }
    }
}

impl Aggregate {
    /// `reduce` of each figure over the rows that have it.
    fn of(rows: &[Self], reduce: fn(&mut [f64]) -> Option<f64>) -> Self {
        let over = |figure: fn(&Self) -> Option<f64>| {
            let mut values: Vec<f64> = rows.iter().filter_map(figure).collect();
            reduce(&mut values)
        };
        Self {
            seconds: over(|row| row.seconds),
            junctions: over(|row| row.junctions),
            edges: over(|row| row.edges),
            explained_length_share: over(|row| row.explained_length_share),
            mean_reprojection_error_in_pixels: over(|row| row.mean_reprojection_error_in_pixels),
            junction_precision: over(|row| row.junction_precision),
            junction_recall: over(|row| row.junction_recall),
            segment_precision: over(|row| row.segment_precision),
            segment_recall: over(|row| row.segment_recall),
        }
    }
}

fn mean(values: &mut [f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    let upper = *values.get(middle)?;
    match values.len() % 2 {
        0 => Some(0.5 * (values[middle - 1] + upper)),
        _ => Some(upper),
    }
}

impl JobSummary {
    /// The job as it stands in `out`. Nothing that is wrong with its files keeps
    /// others from being summed up: it is the `error` of this one.
    fn read(out: &Path, job: &Job) -> Self {
        let folder = JobFolder::new(out, job);
        let mut summary = Self {
            name: job.name.clone(),
            scene: job.scene.clone(),
            ..Self::default()
        };
        if let Err(error) = summary.take_state(&folder, job) {
            summary.error = Some(error.to_string());
        }
        if summary.state == JobState::Finished {
            match read_result(&folder.run(), job.truth_file().as_deref()) {
                Ok(figures) => summary.figures = Some(figures),
                Err(error) => summary.error = Some(error.to_string()),
            }
        }
        summary
    }

    /// What has become of the job, by its record or else by its run.
    fn take_state(&mut self, folder: &JobFolder, job: &Job) -> Result<(), BatchError> {
        let Some(record) = folder.read_record()? else {
            (self.state, self.seconds) = read_state(&folder.run())?;
            return Ok(());
        };
        self.state = record.state;
        self.attempts = record.attempts.len();
        self.seconds = record.seconds();
        // Whoever works on it has the lock; without, the record is a dead one's.
        if record.state == JobState::Running && folder.lock()?.is_some() {
            self.state = JobState::Interrupted;
        }
        self.error = match record.difference(job) {
            Some(difference) if record.state == JobState::Finished => {
                Some(format!("the result is of another job: {difference}"))
            }
            _ => record.error,
        };
        Ok(())
    }

    /// Its figures as numbers.
    pub(crate) fn row(&self) -> Aggregate {
        let figures = self.figures.as_ref();
        let scores = figures.and_then(|figures| figures.evaluation.as_ref());
        let graph = scores.map(|scores| &scores.wireframe);
        let junctions = graph.and_then(|graph| graph.junctions.first());
        let segments = graph.and_then(|graph| graph.segments_max.first());
        Aggregate {
            seconds: (self.state != JobState::Pending).then_some(self.seconds),
            junctions: figures.map(|figures| figures.junctions as f64),
            edges: figures.map(|figures| figures.edges as f64),
            explained_length_share: figures.and_then(|f| f.explained_length_share),
            mean_reprojection_error_in_pixels: figures
                .and_then(|f| f.mean_reprojection_error_in_pixels),
            junction_precision: junctions.map(|score| score.precision),
            junction_recall: junctions.map(|score| score.recall),
            segment_precision: segments.map(|score| score.precision),
            segment_recall: segments.map(|score| score.recall),
        }
    }
}

impl Summary {
    /// Sums up all jobs of `batch`, as they stand in `out`.
    pub fn read(batch: &Batch, out: &Path) -> Self {
        let jobs = batch.jobs().iter().map(|job| JobSummary::read(out, job));
        let jobs: Vec<JobSummary> = jobs.collect();
        Self {
            totals: Totals::of(&jobs),
            jobs,
        }
    }

    /// Whether every job is finished.
    pub fn is_finished(&self) -> bool {
        self.totals.finished == self.jobs.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_and_medians_leave_out_what_is_not_there() {
        let row = |seconds, edges| Aggregate {
            seconds,
            edges,
            ..Aggregate::default()
        };
        let rows = [
            row(Some(1.0), None),
            row(Some(9.0), Some(4.0)),
            row(Some(2.0), None),
        ];
        let means = Aggregate::of(&rows, mean);
        assert_eq!((means.seconds, means.edges), (Some(4.0), Some(4.0)));
        assert_eq!(means.junctions, None);
        assert_eq!(Aggregate::of(&rows, median).seconds, Some(2.0));
        assert_eq!(Aggregate::of(&rows[..2], median).seconds, Some(5.0));
    }
}
