#!/usr/bin/env bash
# Makes a runner of GitHub ready: the newest stable Rust, with rustfmt and clippy.
set -euo pipefail
rustup toolchain install stable --profile minimal --component rustfmt,clippy
rustup default stable
rustc --version
