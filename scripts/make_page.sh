#!/usr/bin/env bash
# Builds the page that runs neat in a browser: a folder of static files for any web server.
#
#   scripts/make_page.sh OUT
#
# Needs the Rust targets wasm32-wasip1 and wasm32-wasip1-threads, Node 18, curl and the network:
# the file system in memory is @bjorn3/browser_wasi_shim, a release that has to be what it was when its sum was written
# here. With $NEAT_WASI_SHIM=FILE it is not downloaded.
set -euo pipefail
cd "$(dirname "$0")/.."

SHIM=browser_wasi_shim-0.4.2.tgz
SHIM_SHA256=9c0281520d0e99f027ec7c1c79b4036c0f8168ed9bf98aba19db4737a1333782

fail() {
    echo "error: $1" >&2
    exit 1
}

[ $# = 1 ] || fail "usage: scripts/make_page.sh OUT"
mkdir -p "$1"
out=$(cd "$1" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

shim=${NEAT_WASI_SHIM:-}
if [ -z "$shim" ]; then
    shim=$work/$SHIM
    curl --fail --silent --show-error --location --max-time 120 --output "$shim" \
        "https://registry.npmjs.org/@bjorn3/browser_wasi_shim/-/$SHIM"
fi
sha256sum --check --quiet <<<"$SHIM_SHA256  $shim" || fail "$shim is not what it was"

# SIMD of 128 bits is in every browser since 2023. Shared memory has a limit from the start: all
# that 32 bits can name.
export CARGO_TARGET_WASM32_WASIP1_RUSTFLAGS="-C target-feature=+simd128"
export CARGO_TARGET_WASM32_WASIP1_THREADS_RUSTFLAGS="-C target-feature=+simd128 -C link-arg=--max-memory=4294967296"
cargo build --locked --release -p neat-web --target wasm32-wasip1 --target wasm32-wasip1-threads
cp "${CARGO_TARGET_DIR:-target}/wasm32-wasip1/release/neat-web.wasm" "$out/neat.wasm"
cp "${CARGO_TARGET_DIR:-target}/wasm32-wasip1-threads/release/neat-web.wasm" "$out/neat-threads.wasm"

cp neat-web/page/*.js neat-web/page/*.css LICENSE-APACHE LICENSE-MIT "$out/"
tar -xzf "$shim" -C "$work"
rm -rf "$out/wasi"
mkdir "$out/wasi"
cp "$work"/package/dist/*.js "$work"/package/LICENSE-* "$out/wasi/"

# The program knows which script and which style its reports have.
node --no-warnings scripts/page_policy.mjs "$out/neat.wasm" neat-web/page/index.html >"$out/index.html"

for file in neat.wasm neat-threads.wasm; do
    bytes=$(wc -c <"$out/$file")
    zipped=$(gzip -9 --stdout "$out/$file" | wc -c)
    echo "$out/$file: $bytes bytes, $zipped with gzip"
done
