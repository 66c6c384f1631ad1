//! Tells the program which commit it is built from, and for what: `neat --version` says so.
//!
//! The commit is what NEAT_COMMIT says, for builds of sources without their repository, as
//! in a container; else what `cargo package` wrote into the package; else git's HEAD. None
//! of them is no error.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

/// So many digits of a commit are told.
const DIGITS: usize = 12;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=NEAT_COMMIT");
    let given = env::var("NEAT_COMMIT").ok();
    let commit = given
        .filter(|commit| !commit.is_empty())
        .or_else(of_package)
        .or_else(of_repository);
    let commit: String = match commit {
        Some(commit) => commit.trim().chars().take(DIGITS).collect(),
        None => "unknown".to_owned(),
    };
    let target = env::var("TARGET").unwrap_or_else(|_| "unknown".to_owned());
    println!("cargo::rustc-env=NEAT_BUILT_FROM={commit}");
    println!("cargo::rustc-env=NEAT_BUILT_FOR={target}");
}

/// The commit that the sources were packed from.
fn of_package() -> Option<String> {
    let text = fs::read_to_string(".cargo_vcs_info.json").ok()?;
    let (_, rest) = text.split_once("\"sha1\"")?;
    Some(rest.split('"').nth(1)?.to_owned())
}

/// HEAD, if this folder is where it belongs in a repository, and not a copy in another one.
/// The reflog grows with every commit, checkout and merge: the program is built again after
/// these, and otherwise only if it changes.
fn of_repository() -> Option<String> {
    if git(&["rev-parse", "--show-prefix"])? != "neat-cli/" {
        return None;
    }
    for name in ["logs/HEAD", "HEAD"] {
        let path = git(&["rev-parse", "--git-path", name])?;
        // A path that is not there would be built again every time.
        if Path::new(&path).exists() {
            println!("cargo::rerun-if-changed={path}");
            break;
        }
    }
    git(&["rev-parse", "HEAD"])
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.is_empty()).then(|| text.trim().to_owned())
}
