//! Holds CityJSON files to the schema of their version with cjval, the validator of the standard's
//! authors, and to what a schema cannot say: indices of vertices, the shape of the semantics, and,
//! which are warnings elsewhere, vertices that nothing uses or that are there twice.
//!
//! ```text
//! cargo run --manifest-path scripts/cityjson_validity/Cargo.toml -- FILE…
//! ```

use cjval::CJValidator;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut failed = 0;
    let files: Vec<String> = std::env::args().skip(1).collect();
    for path in &files {
        let flaws = match std::fs::read_to_string(path) {
            Ok(text) => flaws(&text),
            Err(error) => vec![error.to_string()],
        };
        failed += usize::from(!flaws.is_empty());
        match flaws.is_empty() {
            true => println!("{path}: valid"),
            false => println!("{path}: FAILED: {}", flaws.join("; ")),
        }
    }
    println!(
        "{} of {} files are valid CityJSON",
        files.len() - failed,
        files.len()
    );
    match failed == 0 && !files.is_empty() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    }
}

/// What is wrong with a file.
fn flaws(text: &str) -> Vec<String> {
    let report = CJValidator::from_str(text).validate();
    let mut flaws = Vec::new();
    for (criterion, summary) in &report {
        if summary.has_errors() {
            flaws.push(format!("{criterion}: {summary}"));
        }
    }
    flaws
}
