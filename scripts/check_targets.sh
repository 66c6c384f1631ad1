#!/usr/bin/env bash
# `cargo check` for machines that are not here, where rustup has or gets their standard library.
#
#   scripts/check_targets.sh          # the crates without burn
#   scripts/check_targets.sh --all    # and the program and the C interface: burn, twice
#
# Nothing is linked and nothing runs: what compiles here may still fail there.
set -euo pipefail
cd "$(dirname "$0")/.."

crates=(neat-core neat-detect neat-stereo neat-doctor neat-wireframe neat-eval neat-export neat-report neat-images)
# What starts processes, which a page in a browser cannot.
native=(neat-batch)
if [ "${1:-}" = --all ]; then
    native+=(neat-cli neat-capi)
fi

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

# Below neat-core `psm` has a little assembly, which wants that machine's compiler.
if [ "$(uname -m)" = aarch64 ] || command -v aarch64-linux-gnu-gcc >/dev/null; then
    check aarch64-unknown-linux-gnu "${crates[@]}" "${native[@]}"
else
    echo "aarch64-unknown-linux-gnu: skipped, there is no aarch64-linux-gnu-gcc"
fi
check x86_64-pc-windows-gnu "${crates[@]}" "${native[@]}"
check wasm32-unknown-unknown "${crates[@]}"
