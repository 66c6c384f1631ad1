#!/usr/bin/env bash
# What a release is made of: a software bill of materials of the program in CycloneDX's format,
# by cargo-cyclonedx, which is built where it is not installed.
#
#   scripts/make_sbom.sh OUT
set -euo pipefail
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if ! command -v cargo-cyclonedx >/dev/null; then
    CARGO_TARGET_DIR=$work/target cargo install --quiet --locked --root "$work" cargo-cyclonedx@0.5.9
    PATH=$work/bin:$PATH
fi
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
# It writes beside the manifest of every member; the program's has all that it is linked of.
cargo cyclonedx --quiet --format json --spec-version 1.5 --override-filename neat-sbom
mv neat-cli/neat-sbom.json "$out/neat-$version.cdx.json"
find . -path ./target -prune -o -name neat-sbom.json -exec rm {} +
echo "$out/neat-$version.cdx.json"
