#!/usr/bin/env bash
# Puts the files of a folder into a draft of the release $TAG, for a person to look at and
# publish, with one list of all checksums.
#
#   TAG=v0.1.0 scripts/publish_release.sh DIST
set -euo pipefail
cd "$1"
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$OLDPWD/Cargo.toml" | head -1)
if [ "$TAG" != "v$version" ]; then
    echo "error: the tag is $TAG, and Cargo.toml says $version" >&2
    exit 1
fi
sha256sum --check --quiet ./*.tar.gz.sha256 ./*.zip.sha256
rm ./*.sha256
files=(*)
sha256sum "${files[@]}" >SHA256SUMS
gh release create "$TAG" --draft --title "neat $version" --verify-tag \
    --notes "See CHANGELOG.md." "${files[@]}" SHA256SUMS
