//! What a person sees of a run: a progress bar on a terminal, a line now and then
//! elsewhere.

use crate::{duration, output};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use neat_pipeline::event::{Event, Stage};
use neat_train::LOSS_TERMS;
use neat_train::trainer::StepReport;
use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

/// Without a terminal there is one line per so much time.
const LINE_INTERVAL: Duration = Duration::from_secs(10);
/// For programs, steps and shares of a stage come at most so often.
const JSON_INTERVAL: Duration = Duration::from_millis(100);
/// Parts of the bar.
const TICKS: u64 = 1000;

/// How progress is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ProgressFormat {
    /// For people
    #[default]
    Text,
    /// For programs: one JSON object per line
    Json,
}

/// Shows the events of a run.
pub struct Progress {
    quiet: bool,
    format: ProgressFormat,
    bar: Option<ProgressBar>,
    stage_start: Instant,
    /// How much was done when this session of a resumed run began.
    first_fraction: Option<f64>,
    last_line: Instant,
}

impl Progress {
    /// Shows everything, or only warnings.
    pub fn new(quiet: bool) -> Self {
        Self::with_format(quiet, ProgressFormat::Text)
    }

    /// The same, for people or for programs.
    pub fn with_format(quiet: bool, format: ProgressFormat) -> Self {
        let on_terminal = !quiet && format == ProgressFormat::Text && stderr().is_terminal();
        Self {
            quiet,
            format,
            bar: on_terminal.then(bar),
            stage_start: Instant::now(),
            first_fraction: None,
            last_line: Instant::now(),
        }
    }

    /// Shows one event.
    pub fn show(&mut self, event: Event<'_>) {
        if self.format == ProgressFormat::Json {
            return self.show_json(&event);
        }
        match event {
            Event::StageStarted(stage) => self.start(stage),
            Event::StageProgress { fraction, .. } => self.update(fraction, ""),
            Event::Step { report, fraction } => self.update(fraction, &describe(report)),
            Event::StageFinished { stage, seconds } => {
                self.line(&format!("{stage:<10} {}", duration::display(seconds)));
            }
            Event::Note(note) => self.line(&note),
            Event::Decided(decision) => self.line(&decision.to_string()),
            Event::Resumed { step, steps } => {
                self.line(&format!("training goes on after step {step} of {steps}"));
            }
            Event::Warning(warning) => self.print(&format!("warning: {warning}")),
            Event::Detected(_) | Event::FileWritten(_) => {}
        }
    }

    fn show_json(&mut self, event: &Event<'_>) {
        let often = match event {
            Event::Step { fraction, .. } | Event::StageProgress { fraction, .. } => *fraction < 1.0,
            _ => false,
        };
        if often {
            if self.last_line.elapsed() < JSON_INTERVAL {
                return;
            }
            self.last_line = Instant::now();
        }
        if !self.quiet || matches!(event, Event::Warning(_)) {
            output::note(&event.to_json().to_string());
        }
    }

    /// Shows so much of a named part of the work.
    pub fn show_part(&mut self, part: &str, fraction: f64) {
        self.update(fraction, part);
    }

    fn start(&mut self, stage: Stage) {
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
    // Terms that are off are 0.
    let terms: Vec<String> = (LOSS_TERMS.iter())
        .map(|term| (term.name, term.of(&report.losses)))
        .filter(|(_, value)| *value != 0.0)
        .map(|(name, value)| format!("{name} {value:.4}"))
        .collect();
    format!(
        "step {}, loss {:.4} ({}), ends {:.1} px off",
        report.iteration,
        report.losses.total,
        terms.join(", "),
        report.segment_error_in_pixels,
    )
}
