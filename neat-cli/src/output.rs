//! Results go to the standard output, everything else to the standard error. What comes from
//! files of others moves no cursor, changes no colours and hides nothing.

use crate::error::CliError;
use std::borrow::Cow;
use std::io::{Write, stderr, stdout};
use tracing_subscriber::EnvFilter;

/// Prints a result.
pub fn print(text: &str) -> Result<(), CliError> {
    let mut out = stdout().lock();
    writeln!(out, "{}", harmless(text.trim_end()))?;
    Ok(out.flush()?)
}

/// Prints a line for people. Where nobody reads, nothing can be done.
pub fn note(text: &str) {
    let _ = writeln!(stderr().lock(), "{}", harmless(text));
}

/// Prints a warning.
pub fn warning(text: &str) {
    note(&format!("warning: {text}"));
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

/// A text with its control characters, and those that turn the direction of writing, as
/// escapes such as `\u{1b}`: all but ends of lines and tabs.
fn harmless(text: &str) -> Cow<'_, str> {
    let is_harmful = |c: char| {
        c.is_control() && !matches!(c, '\n' | '\t')
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(is_harmful) {
        return text.into();
    }
    let mut clean = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_harmful(c) {
            clean.extend(c.escape_default());
        } else {
            clean.push(c);
        }
    }
    clean.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_reaches_the_terminal_but_text() {
        assert_eq!(harmless("a\tb\nc é"), "a\tb\nc é");
        assert_eq!(harmless("\u{1b}[2J\u{7}\r"), r"\u{1b}[2J\u{7}\r");
        assert_eq!(harmless("\u{9b}31m\u{7f}"), r"\u{9b}31m\u{7f}");
        assert_eq!(harmless("gpj.\u{202e}exe"), r"gpj.\u{202e}exe");
    }
}
