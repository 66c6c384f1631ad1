#!/usr/bin/env bash
# Fuzzes the readers of files from outside under AddressSanitizer, one after the other.
#
#   scripts/fuzz.sh SECONDS [READER]...
#
# Without readers all of them. Needs `rustup toolchain install nightly` and
# `cargo install cargo-fuzz`. Corpora grow in fuzz/corpus, which is not committed. What to
# do with a file that is found: see fuzz/README.md.
set -euo pipefail
cd "$(dirname "$0")/../fuzz"

seconds=${1:?usage: fuzz.sh SECONDS [READER]...}
shift
# Without NEAT_READER the program writes the seeds and prints the names of all readers.
mapfile -t readers < <(env -u NEAT_READER cargo +nightly fuzz run reader corpus)
[ ${#readers[@]} -gt 0 ] || exit 1
[ $# -eq 0 ] || readers=("$@")
# Scenes are folders of small files: in memory, where there is such a place.
[ ! -d /dev/shm ] || export TMPDIR=/dev/shm
export RAYON_NUM_THREADS=1

found=()
for reader in "${readers[@]}"; do
    echo "=== $reader"
    mkdir -p "corpus/$reader" "regressions/$reader" "artifacts/$reader"
    # Memory beyond a gigabyte and ten seconds for a small file are bugs too.
    NEAT_READER=$reader cargo +nightly fuzz run reader "corpus/$reader" "regressions/$reader" -- \
        -artifact_prefix="artifacts/$reader/" -max_total_time="$seconds" -max_len=16384 \
        -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=1024 -print_final_stats=1 \
        || found+=("$reader")
    rmdir --ignore-fail-on-non-empty "regressions/$reader" "artifacts/$reader"
done

if [ ${#found[@]} -gt 0 ]; then
    echo "fuzz.sh: found files in fuzz/artifacts for ${found[*]}" >&2
    exit 1
fi
