#!/usr/bin/env bash
# The C example, compiled by this machine's compiler and run under its AddressSanitizer:
# the same wireframe as the program's, to the byte, and errors and cancellation as promised.
#
#   scripts/check_capi.sh RELEASE
#
# RELEASE holds neat, libneat_capi.so and libneat_capi.a, as target/release does after
# `cargo build --release -p neat-cli -p neat-capi`. Needs cc, and Python 3 to compare.
set -euo pipefail
release=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."

fail() {
    echo "error: $1" >&2
    exit 1
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
neat=$release/neat
library=$release/libneat_capi.so
[ -f "$library" ] || library=$release/libneat_capi.dylib
[ -f "$library" ] || fail "$1 has no libneat_capi: build neat-capi"

strict=(-std=c99 -Wall -Wextra -Wpedantic -Wno-c99-extensions -Werror -g -I neat-capi/include)
example=neat-capi/examples/reconstruct.c
# Whatever the compiler knows: Apple's has no leak detection, others have.
sanitize=(-fsanitize=address,undefined -fno-sanitize-recover=all)
cc "${strict[@]}" "${sanitize[@]}" "$example" "$library" -Wl,-rpath,"$release" -o "$work/sanitized"
cc "${strict[@]}" "$example" "$release/libneat_capi.a" -lm -lpthread -ldl -o "$work/static"
if command -v c++ >/dev/null; then
    c++ -x c++ -std=c++11 -Wall -Wextra -Werror -fsyntax-only neat-capi/include/neat.h
fi

"$neat" synth --out "$work/scene" --solid l-prism --views 16 --image-size 256 >/dev/null
"$neat" reconstruct "$work/scene" --out "$work/of-program" --no-cache --quiet &>/dev/null
for way in sanitized static; do
    "$work/$way" "$work/scene" "$work/$way-run" >"$work/$way.txt" 2>"$work/$way.log" ||
        fail "$way: $(cat "$work/$way.log")"
    cmp "$work/of-program/wireframe.json" "$work/$way-run/wireframe.json"
    grep -qx distill "$work/$way.log" || fail "$way: the listener heard of no distillation"
done
cmp "$work/sanitized.txt" "$work/static.txt"
python3 - "$work/of-program/wireframe.json" "$work/sanitized.txt" <<'PY'
import json
import sys

file = json.load(open(sys.argv[1]))
lines = [line.split() for line in open(sys.argv[2])]
junctions = [[float(x) for x in rest] for kind, *rest in lines if kind == "v"]
edges = [[int(a), int(b)] for kind, a, b, _ in lines if kind == "l"]
probabilities = [float(p) for kind, _, _, p in lines if kind == "l"]
assert junctions == file["junctions"], "other junctions than those of the file"
assert edges == file["edges"], "other edges than those of the file"
assert probabilities == file["edge_fields"]["probability"], "other probabilities"
assert len(edges) >= 12, f"{len(edges)} edges are too few to compare"
print(f"{len(junctions)} junctions, {len(edges)} edges: as those of the program")
PY

# ends CODE WORDS ARGUMENT...: the example ends with this code and says these words.
ends() {
    local code=0
    "$work/sanitized" "${@:3}" >/dev/null 2>"$work/log" || code=$?
    [ "$code" = "$1" ] && grep -q "$2" "$work/log" || fail "exit code $code: $(cat "$work/log")"
}
ends 2 "no/such/scene" no/such/scene "$work/nothing"
ends 2 "$work/static-run" "$work/scene" "$work/static-run"
ends 130 "interrupted" "$work/scene" "$work/cancelled" cancel
echo "errors and cancellation: as promised"
