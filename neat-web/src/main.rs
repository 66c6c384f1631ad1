//! neat without training, for a page in a browser.
//!
//! The program is built for WASI. The page's worker gives it arguments and a file system in
//! memory, and reads JSON from its standard output, an object per line; `event` says what it
//! is:
//!
//! ```text
//! neat-web synthesise SCENE          a synthetic scene as a COLMAP folder
//! neat-web reconstruct SCENE OUT     wireframe.json and report.html of a scene
//! neat-web export JSON FORMAT OUT    a wireframe for other programs
//! neat-web formats                   what it can be exported to
//! neat-web policy                    the page's content security policy
//! ```
//!
//! Exit code 1 after an `error`, 2 for wrong usage.

#![forbid(unsafe_code)]

mod export;
mod listener;
mod policy;
mod reconstruct;
mod synthesise;
mod tell;

use serde_json::json;
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use tell::tell;

const USAGE: &str = "usage: neat-web synthesise SCENE | reconstruct SCENE OUT | \
                     export JSON FORMAT OUT | formats | policy";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match run(&arguments) {
        Some(Ok(())) => ExitCode::SUCCESS,
        Some(Err(error)) => {
            tell(&json!({ "event": "error", "message": with_causes(&*error) }));
            ExitCode::FAILURE
        }
        None => {
            tell(&json!({ "event": "error", "message": USAGE }));
            ExitCode::from(2)
        }
    }
}

/// `None` for wrong usage.
fn run(arguments: &[&str]) -> Option<Result<(), Box<dyn Error>>> {
    Some(match arguments {
        ["synthesise", scene] => synthesise::synthesise(Path::new(scene)),
        ["reconstruct", scene, out] => reconstruct::reconstruct(Path::new(scene), Path::new(out)),
        ["export", json, format, out] => {
            export::export_document(Path::new(json), format, Path::new(out))
        }
        ["formats"] => {
            export::tell_formats();
            Ok(())
        }
        ["policy"] => policy::tell_policy(),
        _ => return None,
    })
}

/// An error with what is behind it, in one line each.
fn with_causes(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text += &format!(": {error}");
        cause = error.source();
    }
    text
}

#[cfg(test)]
mod tests;
