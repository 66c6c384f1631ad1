#!/usr/bin/env bash
# `cargo check` for machines that are not here, where rustup has or gets their standard library.
#
#   scripts/check_targets.sh
#
# Nothing is linked and nothing runs: what compiles here may still fail there.
set -euo pipefail
cd "$(dirname "$0")/.."

free=(neat-core neat-detect neat-doctor neat-wireframe neat-eval neat-export neat-report neat-batch)

# check TARGET CRATE...: says so where the target cannot be had.
check() {
    if ! command -v rustup >/dev/null; then
        echo "$1: skipped, there is no rustup"
        return
    fi
    if ! timeout 300 rustup target add "$1" 2>/dev/null; then
        echo "$1: skipped, rustup does not get its standard library"
        return
    fi
    local packages=()
    for crate in "${@:2}"; do
        packages+=(--package "$crate")
    done
    cargo check --quiet --locked --target "$1" "${packages[@]}"
    echo "$1: ${*:2}"
}

check aarch64-unknown-linux-gnu "${free[@]}" neat-cli neat-capi
check x86_64-pc-windows-gnu "${free[@]}" neat-cli neat-capi
# Batches start processes, which a page cannot.
check wasm32-unknown-unknown "${free[@]/neat-batch/}"
