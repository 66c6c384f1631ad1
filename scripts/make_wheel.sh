#!/usr/bin/env bash
# The wheel of this machine, by maturin, from the crate neat-python.
#
#   scripts/make_wheel.sh OUT
set -euo pipefail
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/python"
python=$work/python/bin/python
[ -x "$python" ] || python=$work/python/Scripts/python.exe
"$python" -m pip install --quiet --disable-pip-version-check 'maturin>=1.9,<2'
"$python" -m maturin build --release --locked --manifest-path neat-python/Cargo.toml --out "$out"
