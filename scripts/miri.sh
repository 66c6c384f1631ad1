#!/usr/bin/env bash
# Interprets the unit tests of the crates without burn under Miri, each for a limited time.
#
#   scripts/miri.sh SECONDS [CRATE]...
#
# No `unsafe` stands in these crates: what Miri can find is in what they depend on (threads,
# byte views, image decoding), used the way they use it. It interprets, some thousand times
# slower than the machine: a test that is not done after SECONDS is stopped and counted as
# too slow. Needs `rustup toolchain install nightly --component miri,rust-src`. The exit code
# is 1 if Miri found something.
set -uo pipefail
cd "$(dirname "$0")/.."

seconds=${1:?usage: miri.sh SECONDS [CRATE]...}
shift
crates=("$@")
[ $# -gt 0 ] || crates=(neat-core neat-detect neat-stereo neat-wireframe neat-eval neat-export neat-report neat-images neat-batch neat-doctor)
# Tests read files and ask for the time. Rayon's queues need the newer model of borrows. Without
# the last, each sine differs by some random last digits: tests of equality mean none of that.
export MIRIFLAGS="-Zmiri-disable-isolation -Zmiri-tree-borrows -Zmiri-ignore-leaks -Zmiri-deterministic-floats"
export PROPTEST_FAILURE_PERSISTENCE=off
export RAYON_NUM_THREADS=2

found=()
for crate in "${crates[@]}"; do
    mapfile -t tests < <(cargo +nightly miri test -q -p "$crate" --lib -- --list 2>/dev/null | sed -n 's/: test$//p')
    [ ${#tests[@]} -gt 0 ] || { echo "miri.sh: no tests of $crate could be listed" >&2; exit 1; }
    passed=0 slow=0 unable=0
    started=$SECONDS
    for test in "${tests[@]}"; do
        began=$SECONDS
        output=$(timeout "$seconds" cargo +nightly miri test -q -p "$crate" --lib -- --exact "$test" 2>&1)
        case $? in
            0) passed=$((passed + 1)) said=passed ;;
            124) slow=$((slow + 1)) said='too slow' ;;
            *)
                # What Miri has no shim for (processes, system calls) is no finding.
                if grep -q "unsupported operation" <<<"$output"; then
                    unable=$((unable + 1)) said='not possible'
                else
                    found+=("$crate $test") said=FAILED
                    echo "$output" | tail -40
                fi
                ;;
        esac
        echo "$crate $test: $said, $((SECONDS - began)) s"
    done
    echo "$crate: ${#tests[@]} tests, $passed passed, $slow longer than $seconds s, $unable not possible, $((SECONDS - started)) s"
done

if [ ${#found[@]} -gt 0 ]; then
    printf 'miri.sh: failed: %s\n' "${found[@]}" >&2
    exit 1
fi
