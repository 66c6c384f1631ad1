#!/usr/bin/env bash
# Every crate that can be published, packed, unpacked, and checked with nothing but what the
# packages hold.
#
#   scripts/check_packages.sh [OPTION OF CARGO CHECK...]
#
# `cargo package` would build each with all of its dependencies, in a profile that nothing else
# here has. This packs without that, unpacks all packages side by side, and runs `cargo check`
# on them with the profiles, the lock file and the target folder of this repository, so that
# other crates need not be checked once more where clippy ran with the same features. What it
# does not see, a dependency that lacks a feature and has it from a sibling, is for
# `scripts/check_packages.sh --alone`, which is `cargo package` as it comes.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() {
    echo "error: $1" >&2
    exit 1
}

target=$(cargo metadata --format-version 1 --no-deps | python3 -c '
import json, sys
print(json.load(sys.stdin)["target_directory"])')
# Those without `publish = false`, in the order of the workspace.
crates=$(cargo metadata --format-version 1 --no-deps | python3 -c '
import json, sys
for package in json.load(sys.stdin)["packages"]:
    if package["publish"] is None:
        print(package["name"])')
selected=()
for crate in $crates; do
    selected+=(--package "$crate")
done

if [ "${1:-}" = --alone ]; then
    exec cargo package --locked --allow-dirty "${selected[@]}"
fi

# A working tree with changes can be checked, too.
cargo package --quiet --locked --allow-dirty --no-verify "${selected[@]}" 2>&1 |
    { grep -v 'is not included in the published package' || true; } >&2

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
for crate in $crates; do
    package=$target/package/$crate-$version.crate
    # With the time of now: those in packages are all alike, and cargo tells changes by them.
    tar -xzmf "$package" -C "$work"
    folder=$work/$crate-$version
    for name in README.md LICENSE-MIT LICENSE-APACHE Cargo.toml; do
        [ -s "$folder/$name" ] || fail "the package of $crate lacks $name"
    done
    for key in description documentation keywords categories license readme; do
        grep -q "^$key = " "$folder/Cargo.toml" || fail "$crate states no $key"
    done
    ! [ -e "$folder/tests" ] || fail "the package of $crate holds tests, which read what it lacks"
    if grep -nE '^path = "\.\.' "$folder/Cargo.toml"; then
        fail "the package of $crate names a path outside of it"
    fi
    # crates.io takes 10 MB; ours are code.
    size=$(wc -c <"$package")
    [ "$size" -lt 500000 ] || fail "the package of $crate has $size bytes: what is in it?"
done

{
    echo '[workspace]'
    echo 'resolver = "3"'
    echo 'members = ['
    for crate in $crates; do echo "    \"$crate-$version\","; done
    echo ']'
    echo '[patch.crates-io]'
    for crate in $crates; do echo "$crate = { path = \"$crate-$version\" }"; done
    # The profiles are the tail of ours.
    sed -n '/^\[profile\.release\]/,$p' Cargo.toml
} >"$work/Cargo.toml"
cp Cargo.lock "$work"
# With `--locked` the members that are not published would be missed.
CARGO_TARGET_DIR=$target cargo check --offline --quiet --release --workspace \
    --manifest-path "$work/Cargo.toml" "$@"
echo "$(wc -w <<<"$crates") packages compile from what they hold"
