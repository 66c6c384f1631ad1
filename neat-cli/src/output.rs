//! Results go to the standard output, everything else to the standard error.

use crate::error::CliError;
use std::io::{Write, stderr, stdout};
use tracing_subscriber::EnvFilter;

/// Prints a result.
pub fn print(text: &str) -> Result<(), CliError> {
    let mut out = stdout().lock();
    writeln!(out, "{}", text.trim_end())?;
    Ok(out.flush()?)
}

/// Prints a line for people. Where nobody reads, nothing can be done.
pub fn note(text: &str) {
    let _ = writeln!(stderr().lock(), "{text}");
}

/// Prints an error.
pub fn error(text: &str) {
    note(&format!("error: {text}"));
}

/// Prints what to do about an error.
pub fn error_hint(text: &str) {
    note(&format!("hint: {text}"));
}

/// Shows the log messages that the variable `NEAT_LOG` asks for, such as
/// `NEAT_LOG=debug`; none by default.
pub fn init_log() {
    let filter = EnvFilter::try_from_env("NEAT_LOG").unwrap_or_else(|_| EnvFilter::new("off"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(stderr)
        .init();
}
