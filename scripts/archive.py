#!/usr/bin/env python3
"""Packs a folder into an archive, with its checksum beside it.

    scripts/archive.py FOLDER OUT --format FORMAT

FORMAT is tar.gz or zip. Writes OUT/FOLDER.FORMAT and the same with .sha256 behind it, and prints
the first. The same files make the same bytes: all are of one time, SOURCE_DATE_EPOCH or else that
of the last commit, and of no owner. Needs Python 3.9 and nothing else.
"""

import argparse
import gzip
import hashlib
import os
import pathlib
import subprocess
import tarfile
import time
import zipfile

# 1980, the first that a ZIP archive can name.
OLDEST = 315532800


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--format", choices=WRITERS, required=True)
    return parser.parse_args()


def time_of_files():
    if "SOURCE_DATE_EPOCH" in os.environ:
        return int(os.environ["SOURCE_DATE_EPOCH"])
    here = pathlib.Path(__file__).parent
    log = subprocess.run(
        ["git", "log", "-1", "--format=%ct"], cwd=here, capture_output=True, text=True
    )
    return int(log.stdout) if log.returncode == 0 else OLDEST


def mode(path):
    return 0o755 if path.stat().st_mode & 0o100 else 0o644


def write_zip(archive, folder, files, when):
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as pack:
        for path in files:
            name = path.relative_to(folder.parent).as_posix()
            info = zipfile.ZipInfo(name, time.gmtime(when)[:6])
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = mode(path) << 16
            pack.writestr(info, path.read_bytes())


def write_tar(archive, folder, files, when):
    with archive.open("wb") as raw, gzip.GzipFile("", "wb", 9, raw, when) as packed:
        with tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as pack:
            for path in files:
                info = tarfile.TarInfo(path.relative_to(folder.parent).as_posix())
                info.size, info.mtime, info.mode = path.stat().st_size, when, mode(path)
                with path.open("rb") as content:
                    pack.addfile(info, content)


WRITERS = {"tar.gz": write_tar, "zip": write_zip}


def main():
    options = arguments()
    folder = options.folder.resolve()
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    archive = options.out / f"{folder.name}.{options.format}"
    WRITERS[options.format](archive, folder, files, time_of_files())
    digest = hashlib.sha256(archive.read_bytes()).hexdigest()
    # As sha256sum writes it, whatever the system's ends of lines.
    line = f"{digest}  {archive.name}\n".encode()
    (options.out / f"{archive.name}.sha256").write_bytes(line)
    print(archive)


if __name__ == "__main__":
    main()
