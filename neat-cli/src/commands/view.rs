//! `neat view`.

use crate::error::CliError;
use crate::output;
use clap::Args;
use neat_core::SceneError;
use neat_pipeline::run_dir::RunDir;
use std::path::PathBuf;

/// Open the report of a run in the browser
///
/// The report is one file without network access: RUN/report.html. Its path is printed: where
/// no browser can be started, copy it to a machine that has one.
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
        let path = report.display().to_string();
        if self.print_path {
            return output::print(&path);
        }
        open::that_detached(&report).map_err(|error| CliError::Browser {
            report: path.clone(),
            reason: error.to_string(),
        })?;
        // The program that opens files may have nothing to show it with, and not say so.
        output::print(&format!("opened {path}"))
    }
}
