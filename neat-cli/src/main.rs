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

use arguments::Cli;
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::parse();
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => error.report(),
    }
}
