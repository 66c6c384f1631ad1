#!/usr/bin/env bash
# The archive of a release for this machine: programs, C library, licences, completions,
# manual pages; and its checksum.
#
#   scripts/make_release.sh OUT                  # builds first
#   scripts/make_release.sh OUT --built RELEASE  # of what lies there, as target/release
#
# Writes OUT/neat-VERSION-TARGET.tar.gz (.zip on Windows) and the same with .sha256 behind it.
# The same files make the same bytes. SOURCE_DATE_EPOCH is the time of all files, else that of
# the commit.
set -euo pipefail
out=$1
built=
if [ "${2:-}" = --built ]; then
    built=$(cd "$3" && pwd)
elif [ $# -gt 1 ]; then
    echo "error: unknown argument $2" >&2
    exit 2
fi
mkdir -p "$out"
out=$(cd "$out" && pwd)
cd "$(dirname "$0")/.."

if [ -z "$built" ]; then
    cargo build --locked --release --package neat-cli --package neat-capi
    built=${CARGO_TARGET_DIR:-target}/release
fi
neat=$built/neat
[ -f "$neat" ] || neat=$built/neat.exe
told=$("$neat" --version | tr -d '\r')
version=$(sed -n 's/^neat //p' <<<"$told")
target=$(sed -n 's/^target: //p' <<<"$told")
name=neat-$version-$target

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
folder=$work/$name
mkdir -p "$folder/completions" "$folder/lib" "$folder/include"
cp "$neat" README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$folder"
cp neat-capi/include/neat.h "$folder/include"
for library in libneat_capi.so libneat_capi.dylib neat_capi.dll neat_capi.dll.lib; do
    [ ! -f "$built/$library" ] || cp "$built/$library" "$folder/lib"
done
[ -n "$(ls "$folder/lib")" ] || {
    echo "error: $built has no library of neat-capi: build it with --package neat-capi" >&2
    exit 1
}
"$neat" completions bash >"$folder/completions/neat.bash"
"$neat" completions zsh >"$folder/completions/_neat"
"$neat" completions fish >"$folder/completions/neat.fish"
"$neat" completions elvish >"$folder/completions/neat.elv"
"$neat" completions powershell >"$folder/completions/_neat.ps1"
"$neat" man "$folder/man/man1" >/dev/null

format=tar.gz
[ ! -f "$folder/neat.exe" ] || format=zip
python3 scripts/archive.py "$folder" "$out" --format "$format"
