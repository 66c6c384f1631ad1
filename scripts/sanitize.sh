#!/usr/bin/env bash
# Unsafe code under Miri and AddressSanitizer: the kernels of neat-tensor, and what the
# readers of neat-core call in other crates.
#
#   scripts/sanitize.sh [kernels-address|kernels-miri|readers-miri]...
#
# Without arguments all three. Needs `rustup toolchain install nightly --component miri
# --component rust-src`. The kernels are compiled alone, without burn: see fuzz/kernels.
set -euo pipefail
cd "$(dirname "$0")/.."

host=$(rustc +nightly -vV | sed -n 's/^host: //p')
[ $# -gt 0 ] || set -- kernels-address kernels-miri readers-miri

for part in "$@"; do
    printf '\n=== %s (%d:%02d)\n' "$part" $((SECONDS / 60)) $((SECONDS % 60))
    case $part in
    kernels-address)
        # Every instruction set of this machine, with threads. Leaks are no errors: buffers
        # stay in a pool.
        RUSTFLAGS=-Zsanitizer=address ASAN_OPTIONS=detect_leaks=0 cargo +nightly test --release \
            --manifest-path fuzz/Cargo.toml -p neat-kernels --target "$host"
        ;;
    kernels-miri)
        # Plain code: Miri knows no instruction sets, and stacked borrows no crossbeam.
        MIRIFLAGS='-Zmiri-tree-borrows -Zmiri-disable-isolation -Zmiri-ignore-leaks' \
            cargo +nightly miri test --manifest-path fuzz/Cargo.toml -p neat-kernels
        ;;
    readers-miri)
        MIRIFLAGS='-Zmiri-tree-borrows -Zmiri-disable-isolation -Zmiri-ignore-leaks' \
            cargo +nightly miri test --locked -p neat-core --lib -- \
            damaged truncated never_panic panic
        ;;
    *)
        echo "sanitize.sh: no part is called $part" >&2
        exit 2
        ;;
    esac
done
