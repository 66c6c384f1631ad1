#!/usr/bin/env bash
# The archive of a release, made of what is built, unpacked and tried.
#
#   scripts/check_release.sh RELEASE      # such as target/release
set -euo pipefail
built=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."

fail() {
    echo "error: $1" >&2
    exit 1
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
archive=$(scripts/make_release.sh "$work/one" --built "$built")
scripts/make_release.sh "$work/two" --built "$built" >/dev/null
cmp "$archive" "$work/two/$(basename "$archive")" || fail "the same files make other bytes"
(cd "$work/one" && { sha256sum --check --quiet ./*.sha256 || shasum -a 256 --check ./*.sha256; })

tar -xzf "$archive" -C "$work"
folder=$work/$(basename "$archive" .tar.gz)
"$folder/neat" --version
bash --norc -c 'source "$1" && complete -p neat' bash "$folder/completions/neat.bash" >/dev/null
for file in README.md LICENSE-MIT LICENSE-APACHE CHANGELOG.md completions/_neat \
    completions/neat.fish man/man1/neat.1 man/man1/neat-reconstruct.1; do
    [ -s "$folder/$file" ] || fail "the archive lacks $file"
done
if command -v man >/dev/null; then
    MANPATH=$folder/man MANWIDTH=80 man neat-reconstruct | grep -q SYNOPSIS ||
        fail "man finds no page of neat-reconstruct"
fi
# Where `cargo binstall` looks for the program.
grep -q '^bin-dir = "neat-{ version }-{ target }/{ bin }{ binary-ext }"' neat-cli/Cargo.toml ||
    fail "neat-cli/Cargo.toml tells cargo binstall another place than $(basename "$folder")/neat"
if command -v cc >/dev/null; then
    cc -std=c99 -I "$folder/include" neat-capi/examples/reconstruct.c \
        -L "$folder/lib" -lneat_capi -o "$work/example"
fi
echo "$(basename "$archive"): $(wc -c <"$archive") bytes, $(find "$folder" -type f | wc -l) files"
