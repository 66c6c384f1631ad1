//! What a person sees of a run: a progress bar on a terminal, a line now and then
//! elsewhere.

use crate::{duration, output};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use neat_pipeline::event::{Event, Stage};
use neat_train::trainer::StepReport;
use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

/// Without a terminal there is one line per so much time.
const LINE_INTERVAL: Duration = Duration::from_secs(10);
/// Parts of the bar.
const TICKS: u64 = 1000;

/// Shows the events of a run.
pub struct Progress {
    quiet: bool,
    bar: Option<ProgressBar>,
    stage_start: Instant,
    /// How much was done when this session of a resumed run began.
    first_fraction: Option<f64>,
    last_line: Instant,
}

impl Progress {
    /// Shows everything, or only warnings.
    pub fn new(quiet: bool) -> Self {
        let on_terminal = !quiet && stderr().is_terminal();
        Self {
            quiet,
            bar: on_terminal.then(bar),
            stage_start: Instant::now(),
            first_fraction: None,
            last_line: Instant::now(),
        }
    }

    /// Shows one event.
    pub fn show(&mut self, event: Event<'_>) {
        match event {
            Event::StageStarted(stage) => self.start(stage),
            Event::StageProgress { fraction, .. } => self.update(fraction, ""),
            Event::Step { report, fraction } => self.update(fraction, &describe(report)),
            Event::StageFinished { stage, seconds } => {
                tracing::info!("{stage} ends");
                self.line(&format!("{stage:<10} {}", duration::display(seconds)));
            }
            Event::Note(note) => self.line(&note),
            Event::Warning(warning) => self.print(&format!("warning: {warning}")),
            Event::FileWritten(path) => tracing::info!("wrote {}", path.display()),
        }
    }

    /// Shows so much of a named part of the work.
    pub fn show_part(&mut self, part: &str, fraction: f64) {
        self.update(fraction, part);
    }

    fn start(&mut self, stage: Stage) {
        tracing::info!("{stage} begins");
        self.stage_start = Instant::now();
        self.last_line = Instant::now();
        self.first_fraction = None;
        if let Some(bar) = &self.bar {
            bar.reset();
            bar.set_prefix(format!("{stage:<10}"));
            bar.set_message("");
        }
    }

    fn update(&mut self, fraction: f64, message: &str) {
        // Time first: a narrow terminal cuts the end off.
        let parts = [self.time_left(fraction), Some(message.to_owned())];
        let parts: Vec<String> = parts
            .into_iter()
            .flatten()
            .filter(|part| !part.is_empty())
            .collect();
        let message = parts.join(", ");
        if let Some(bar) = &self.bar {
            bar.set_position((fraction * TICKS as f64) as u64);
            bar.set_message(message);
        } else if self.last_line.elapsed() >= LINE_INTERVAL {
            self.last_line = Instant::now();
            self.line(&format!("{:3.0} %, {message}", 100.0 * fraction));
        }
    }

    /// Time left, if this session of the run goes on as it did.
    fn time_left(&mut self, fraction: f64) -> Option<String> {
        let first = *self.first_fraction.get_or_insert(fraction);
        let done = fraction - first;
        (done > 0.0).then(|| {
            let seconds = self.stage_start.elapsed().as_secs_f64() * (1.0 - fraction) / done;
            format!("{} left", duration::display(seconds))
        })
    }

    /// Prints a line that `--quiet` suppresses.
    fn line(&self, text: &str) {
        if !self.quiet {
            self.print(text);
        }
    }

    fn print(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| output::note(text)),
            None => output::note(text),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(TICKS), ProgressDrawTarget::stderr());
    // The template is fixed; were it wrong, the bar would look plain.
    if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:24} {percent:>3} % {wide_msg}") {
        bar.set_style(style);
    }
    bar
}

fn describe(report: &StepReport) -> String {
    let losses = &report.losses;
    format!(
        "step {}, loss {:.4} (rgb {:.4}, eikonal {:.4}, segment {:.4}, junction {:.4}), ends {:.1} px off",
        report.iteration,
        losses.total,
        losses.rgb,
        losses.eikonal,
        losses.segment,
        losses.junction_3d,
        report.segment_error_in_pixels,
    )
}
