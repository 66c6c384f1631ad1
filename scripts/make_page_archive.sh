#!/usr/bin/env bash
# The page that runs neat in a browser, as an archive of a release, and its checksum.
#
#   scripts/make_page_archive.sh OUT
#
# Writes OUT/neat-page-VERSION.zip and the same with .sha256 behind it. Needs what
# scripts/make_page.sh needs, and rustup, which gets the targets.
set -euo pipefail
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
rustup target add wasm32-wasip1 wasm32-wasip1-threads
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
folder=$work/neat-page-$version
scripts/make_page.sh "$folder"
python3 scripts/archive.py "$folder" "$out" --format zip
