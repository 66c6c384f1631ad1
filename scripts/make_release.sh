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

time=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || echo 315532800)}
python3 - "$folder" "$out" "$time" <<'PY'
import gzip
import hashlib
import sys
import tarfile
import time
import zipfile
from pathlib import Path

folder, out, when = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
files = sorted(path for path in folder.rglob("*") if path.is_file())
mode = lambda path: 0o755 if path.parent in (folder, folder / "lib") and not path.suffix[1:] in (
    "md", "lib") and not path.name.startswith("LICENSE") else 0o644

if (folder / "neat.exe").is_file():
    archive = out / f"{folder.name}.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as pack:
        for path in files:
            inside = path.relative_to(folder.parent).as_posix()
            info = zipfile.ZipInfo(inside, time.gmtime(when)[:6])
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = mode(path) << 16
            pack.writestr(info, path.read_bytes())
else:
    archive = out / f"{folder.name}.tar.gz"
    with archive.open("wb") as raw, gzip.GzipFile("", "wb", 9, raw, when) as packed:
        with tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as pack:
            for path in files:
                info = tarfile.TarInfo(path.relative_to(folder.parent).as_posix())
                info.size, info.mtime, info.mode = path.stat().st_size, when, mode(path)
                with path.open("rb") as content:
                    pack.addfile(info, content)
digest = hashlib.sha256(archive.read_bytes()).hexdigest()
# As sha256sum writes it, whatever the system's ends of lines.
(out / f"{archive.name}.sha256").write_bytes(f"{digest}  {archive.name}\n".encode())
print(archive)
PY
