#!/usr/bin/env bash
# The unsafe code of this repository, which is the kernels of neat-tensor, under
# AddressSanitizer: every instruction set of this machine, with threads.
#
#   scripts/sanitize.sh
#
# Needs `rustup toolchain install nightly`. The kernels are compiled alone, without burn:
# see fuzz/kernels.
set -euo pipefail
cd "$(dirname "$0")/.."

host=$(rustc +nightly -vV | sed -n 's/^host: //p')
# Leaks are no errors: buffers stay in a pool.
RUSTFLAGS=-Zsanitizer=address ASAN_OPTIONS=detect_leaks=0 cargo +nightly test --release \
    --manifest-path fuzz/Cargo.toml -p neat-kernels --target "$host"
