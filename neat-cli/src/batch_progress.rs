//! What a person sees of a batch: a table of running jobs on a terminal, a line per
//! event elsewhere.

use crate::{duration, output};
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use neat_batch::{Job, JobEvent, JobFolder, Stop, read_result};
use std::collections::BTreeMap;
use std::io::{IsTerminal, stderr};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Rows show that time passes so often.
const TICK: Duration = Duration::from_millis(500);

/// A row of the table.
const RUNNING: &str = "{prefix:20!} {elapsed:>4} {wide_msg}";
/// A row whose worker has nothing to do.
const IDLE: &str = "{wide_msg}";
/// The last row.
const TOTAL: &str = "{bar:24} {pos}/{len} jobs {elapsed:>4} {wide_msg}";

/// Shows the events of a batch.
pub struct BatchProgress {
    quiet: bool,
    out: PathBuf,
    table: Option<Mutex<Table>>,
}

/// A row for each worker, and one for the whole batch.
struct Table {
    drawn: MultiProgress,
    rows: Vec<ProgressBar>,
    total: ProgressBar,
    /// The row of each running job.
    running: BTreeMap<String, usize>,
    failed: usize,
}

impl BatchProgress {
    /// Shows everything, or only failures.
    pub fn new(quiet: bool, jobs: usize, workers: usize, out: &Path) -> Self {
        let on_terminal = !quiet && stderr().is_terminal();
        Self {
            quiet,
            out: out.into(),
            table: on_terminal.then(|| Mutex::new(Table::new(jobs, workers))),
        }
    }

    /// Shows one event.
    pub fn show(&self, job: &Job, event: &JobEvent) {
        if let Some(mut table) = self.table() {
            table.update(job, event);
        }
        let name = &job.name;
        match event {
            JobEvent::Skipped => self.line(&format!("{name}: finished before")),
            JobEvent::Waiting => self.line(&format!(
                "{name}: another process works on it; waiting for its end"
            )),
            JobEvent::Started { attempt, .. } => {
                if self.table.is_none() {
                    self.line(&format!("{name}: attempt {attempt}"));
                }
            }
            JobEvent::Progress { .. } => {}
            JobEvent::Retrying { reason, pause } => {
                let pause = duration::display(pause.as_secs_f64());
                self.line(&format!("{name}: {reason}; once more in {pause}"));
            }
            JobEvent::Finished { seconds } => {
                let time = duration::display(*seconds);
                let figures = self.figures(job);
                self.line(&format!("{name}: finished in {time}{figures}"));
            }
            JobEvent::Failed { reason } => self.print(&format!("{name}: failed: {reason}")),
            JobEvent::Interrupted => self.line(&format!("{name}: interrupted")),
        }
    }

    /// Says that the batch ends.
    pub fn stop(&self, stop: Stop) {
        match stop {
            Stop::No => {}
            Stop::AfterStep => self.print(
                "stopping: running scenes end their step and save (once more: kill them now)",
            ),
            Stop::Now => self.print("stopping: running scenes are killed"),
        }
    }

    /// Removes the table.
    pub fn finish(&self) {
        if let Some(table) = self.table() {
            for bar in table.rows.iter().chain([&table.total]) {
                bar.finish_and_clear();
            }
        }
    }

    /// The result of a job in words, to follow its time; empty if it cannot be read,
    /// which the summary says.
    fn figures(&self, job: &Job) -> String {
        let run = JobFolder::new(&self.out, job).run();
        let Ok(figures) = read_result(&run, None) else {
            return String::new();
        };
        let share = figures.explained_length_share;
        let agreement = share.zip(figures.mean_reprojection_error_in_pixels);
        let agreement = agreement.map_or_else(String::new, |(share, error)| {
            let percent = 100.0 * share;
            format!(", on {percent:.0} % of the length of all 2D segments, {error:.2} px off")
        });
        let (junctions, edges) = (figures.junctions, figures.edges);
        format!(": {junctions} junctions, {edges} edges{agreement}")
    }

    fn table(&self) -> Option<MutexGuard<'_, Table>> {
        let table = self.table.as_ref()?;
        Some(table.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Prints a line that `--quiet` suppresses.
    fn line(&self, text: &str) {
        if !self.quiet {
            self.print(text);
        }
    }

    fn print(&self, text: &str) {
        match self.table() {
            Some(table) => table.drawn.suspend(|| output::note(text)),
            None => output::note(text),
        }
    }
}

impl Table {
    fn new(jobs: usize, workers: usize) -> Self {
        let drawn = MultiProgress::with_draw_target(ProgressDrawTarget::stderr());
        let row = |template: &str, length: u64| {
            let bar = drawn.add(ProgressBar::new(length));
            restyle(&bar, template);
            bar
        };
        let rows = (0..workers).map(|_| row(IDLE, 0)).collect();
        let total = row(TOTAL, jobs as u64);
        total.enable_steady_tick(TICK);
        Self {
            drawn,
            rows,
            total,
            running: BTreeMap::new(),
            failed: 0,
        }
    }

    fn update(&mut self, job: &Job, event: &JobEvent) {
        match event {
            JobEvent::Started { attempt, worker } => {
                let Some(row) = self.rows.get(*worker) else {
                    return;
                };
                restyle(row, RUNNING);
                row.reset_elapsed();
                row.set_prefix(job.name.clone());
                row.set_message(match attempt {
                    1 => String::new(),
                    _ => format!("attempt {attempt}"),
                });
                row.enable_steady_tick(TICK);
                self.running.insert(job.name.clone(), *worker);
            }
            JobEvent::Progress { line } => {
                if let Some(&worker) = self.running.get(&job.name) {
                    self.rows[worker].set_message(line.clone());
                }
            }
            JobEvent::Skipped
            | JobEvent::Waiting
            | JobEvent::Retrying { .. }
            | JobEvent::Finished { .. }
            | JobEvent::Failed { .. }
            | JobEvent::Interrupted => self.release(job, event),
        }
    }

    /// Clears the row of a job that no worker looks at any more, and counts its end.
    fn release(&mut self, job: &Job, event: &JobEvent) {
        if let Some(worker) = self.running.remove(&job.name) {
            let row = &self.rows[worker];
            row.disable_steady_tick();
            row.set_message("");
            restyle(row, IDLE);
        }
        if let JobEvent::Failed { .. } = event {
            self.failed += 1;
            self.total.set_message(format!("{} failed", self.failed));
        }
        let ended = matches!(
            event,
            JobEvent::Skipped | JobEvent::Finished { .. } | JobEvent::Failed { .. }
        );
        self.total.inc(u64::from(ended));
    }
}

/// Draws a row in another way.
fn restyle(row: &ProgressBar, template: &str) {
    // The templates are fixed; were one wrong, its rows would look as before.
    if let Ok(style) = ProgressStyle::with_template(template) {
        row.set_style(style);
    }
}
