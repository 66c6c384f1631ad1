#!/usr/bin/env bash
# What has to hold on a system that .ci/run is not made for: it builds, the tests pass, the
# demonstration reconstructs, an archive comes out. One set of features for all of it.
set -euo pipefail
cd "$(dirname "$0")/.."

built=(--locked --release --package neat-cli --package neat-capi)
free=(neat-core neat-detect neat-stereo neat-doctor neat-wireframe neat-eval neat-export neat-report neat-images neat-web neat-batch)
cargo build "${built[@]}"
for crate in "${free[@]}"; do
    built+=(--package "$crate")
done
cargo test "${built[@]}"
release=${CARGO_TARGET_DIR:-target}/release
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$release/neat" demo --out "$work/demo" --quiet
scripts/make_release.sh "$work/dist" --built "$release"
case $(uname -s) in
# The example wants a linker's `-rpath` and libraries that Windows names otherwise.
Linux | Darwin) scripts/check_capi.sh "$release" ;;
esac
