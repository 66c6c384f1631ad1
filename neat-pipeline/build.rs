//! Tells the crate which compiler builds it, and for what: the manifest of a run
//! says so.

use std::env;
use std::process::Command;

fn main() {
    let compiler = env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let version = Command::new(compiler)
        .arg("--version")
        .output()
        .ok()
        .and_then(|output| String::from_utf8(output.stdout).ok());
    let version = version.as_deref().map_or("unknown", str::trim);
    let target = env::var("TARGET").unwrap_or_else(|_| "unknown".to_owned());
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=NEAT_RUSTC={version}");
    println!("cargo::rustc-env=NEAT_TARGET={target}");
}
