//! `neat view`.

use crate::error::CliError;
use crate::output;
use clap::Args;
use neat_core::SceneError;
use neat_pipeline::run_dir::RunDir;
use std::path::PathBuf;

/// Open the report of a run in the browser
///
/// The report is one file without network access: RUN/report.html. Where no browser can be
/// started, copy it to a machine that has one.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat view RUN
  neat view RUN --print-path")]
pub struct ViewArgs {
    /// Folder of the run
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Print where the report is instead of opening it
    #[arg(long)]
    print_path: bool,
}

impl ViewArgs {
    pub fn run(self) -> Result<(), CliError> {
        let report = RunDir::open(&self.run)?.report();
        if !report.is_file() {
            return Err(CliError::Pipeline(
                SceneError::Missing {
                    path: report,
                    remedy: "`neat distill RUN` writes it".to_owned(),
                }
                .into(),
            ));
        }
        if self.print_path {
            return output::print(&report.display().to_string());
        }
        open::that_detached(&report).map_err(|error| CliError::Browser {
            report: report.display().to_string(),
            reason: error.to_string(),
        })
    }
}
