//! `neat man`.

use super::Cli;
use crate::error::CliError;
use crate::output;
use clap::{Args, CommandFactory};
use neat_core::{SceneError, file};
use std::path::PathBuf;

/// Write the manual pages, one per command
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat man ~/.local/share/man/man1 && man neat-reconstruct")]
pub struct ManArgs {
    /// Folder for the pages, which is made; earlier pages in it are replaced
    #[arg(value_name = "DIR")]
    dir: PathBuf,
}

impl ManArgs {
    pub fn run(self) -> Result<(), CliError> {
        file::create_dir(&self.dir)?;
        let written = clap_mangen::generate_to(Cli::command(), &self.dir);
        written.map_err(|source| SceneError::Write {
            path: self.dir.clone(),
            source,
        })?;
        output::print(&self.dir.display().to_string())
    }
}
