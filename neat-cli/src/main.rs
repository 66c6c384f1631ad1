//! `neat`: posed photographs in, 3D wireframes out.

#![forbid(unsafe_code)]

mod arguments;
mod batch_progress;
mod cache;
mod commands;
mod duration;
mod error;
mod interrupt;
mod memory;
mod output;
mod progress;
mod scene_arguments;
mod threads;
mod version;

use clap::Parser;
use commands::Cli;
use error::CliError;
use neat_core::with_causes;
use std::process::ExitCode;

fn main() -> ExitCode {
    match Cli::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => report(&error),
    }
}

/// Prints an error with its causes, once, and how to go on.
fn report(error: &CliError) -> ExitCode {
    if !error.is_closed_pipe() {
        output::error(&with_causes(error));
    }
    if let Some(hint) = error.hint() {
        output::error_hint(hint);
    }
    error.exit_code().into()
}
