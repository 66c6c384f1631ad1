#!/usr/bin/env bash
# The workflow on 8 small scenes, interrupted once in the middle and started again.
#
#   deploy/snakemake/test.sh [NEAT]    NEAT is target/release/neat by default
#
# Uses the snakemake on the PATH, or else installs one with pip in a temporary folder.
# The script fails unless every scene is finished and every result has the bytes of a
# run without Snakemake.
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
neat=$(realpath "${1:-$here/../../target/release/neat}")
arguments=(--train --backend flex --steps "${STEPS:-300}" --no-cache --no-doctor)
solids=(box l-prism stair-prism hexagonal-prism t-prism u-prism wedge truncated-pyramid)

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
say() { printf '[%4d s] %s\n' "$SECONDS" "$1"; }
fail() {
    echo "error: $1" >&2
    exit 1
}

if ! command -v snakemake >/dev/null; then
    python3 -m venv "$work/python"
    "$work/python/bin/python" -m pip install --quiet --disable-pip-version-check 'snakemake>=8,<10'
    PATH=$work/python/bin:$PATH
fi
say "Snakemake $(snakemake --version)"

for solid in "${solids[@]}"; do
    "$neat" synth --out "$work/scenes/$solid" --solid "$solid" --views 12 --image-size 128 \
        --detection-rate 1 >/dev/null
    "$neat" --quiet --threads 1 reconstruct "$work/scenes/$solid" --out "$work/single/$solid" \
        "${arguments[@]}" >/dev/null 2>"$work/single.log" || { cat "$work/single.log"; fail "$solid alone fails"; }
done
say "8 scenes, each reconstructed alone"

quoted=$(printf '"%s", ' "${arguments[@]}")
cat >"$work/config.yaml" <<END
scenes: "$work/scenes/*"
out: "$work/out"
neat: "$neat"
arguments: [${quoted%, }]
threads: 1
END
workflow() {
    snakemake --snakefile "$here/Snakefile" --configfile "$work/config.yaml" --directory "$work" \
        --cores 2 --keep-going --rerun-incomplete "$@"
}

# In a group of its own, like a command in a terminal: Ctrl-C goes to all of it.
set -m
workflow >"$work/first.log" 2>&1 &
group=$!
set +m
trains() { [ "$(cat "$work"/out/*/run/metrics.jsonl 2>/dev/null | wc -l)" -gt 0 ]; }
until trains; do
    kill -0 "$group" 2>/dev/null || { cat "$work/first.log"; fail "the workflow ends at once"; }
    [ "$SECONDS" -lt 600 ] || fail "no scene is trained"
    sleep 0.2
done
kill -INT -- "-$group"
wait "$group" && fail "the workflow is not interrupted"
done_before=$(find "$work/out" -name finished | wc -l)
say "interrupted by Ctrl-C with $done_before of 8 scenes finished: $(grep -h '"status"' "$work"/out/*/run/manifest.json | sort | uniq -c | tr -s ' \n' ' ')"
[ "$done_before" -lt 8 ] || fail "the interrupt came too late"

workflow >"$work/second.log" 2>&1 || { cat "$work/second.log" "$work"/out/*/log.txt; fail "the second call fails"; }
say "finished by the same command"

# Finished: a third call has nothing to do.
workflow --dry-run 2>&1 | grep -q "Nothing to be done" || fail "finished scenes would be done again"

different=0
for solid in "${solids[@]}"; do
    if ! cmp -s "$work/out/$solid/run/wireframe.json" "$work/single/$solid/wireframe.json"; then
        echo "$solid differs"
        different=$((different + 1))
    fi
done
echo
cat "$work/out/summary.md"
echo
# Bytes of wireframes, not of nothing.
awk -F, 'NR > 1 && $7 < 6 { few = 1 } END { exit few }' "$work/out/summary.csv" \
    || fail "a wireframe has fewer than 6 edges"
[ "$different" = 0 ] || fail "$different results differ from those without Snakemake"
say "8 of 8 results with the same bytes as without Snakemake"
