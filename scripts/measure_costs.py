#!/usr/bin/env python3
"""Time and memory of `neat eval`, `neat batch --dry-run` and the readers against size.

    scripts/measure_costs.py            prints a Markdown table; a minute

Each row is asked for sizes that double, so that what grows faster than its input shows. Times
are of one run each, processor time of all threads; memory is the largest resident set. Needs
Python 3.9 on Linux or macOS and nothing else.
"""

import argparse
import os
import pathlib
import random
import subprocess
import sys
import tempfile

SIZES = 4


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--neat", type=pathlib.Path, default="target/release/neat")
    neat = parser.parse_args().neat.absolute()
    print("| what | size | exit code | s of processor time | MiB |\n|---|--:|--:|--:|--:|")
    with tempfile.TemporaryDirectory() as folder:
        for what, least, prepare in ROWS:
            for size in (least << step for step in range(SIZES)):
                place = pathlib.Path(folder, f"{what}-{size}".replace(" ", "-"))
                place.mkdir()
                code, seconds, mebibytes = measured([neat, *prepare(place, size, neat)])
                print(f"| {what} | {size} | {code} | {seconds:.2f} | {mebibytes:.0f} |", flush=True)


def measured(command):
    """Exit code, processor time, and the largest resident set of a command."""
    child = subprocess.Popen(
        [str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    # Kibibytes on Linux, bytes on macOS.
    scale = 1 << 20 if sys.platform == "darwin" else 1 << 10
    return child.returncode, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / scale


def write_lines(path, count, seed):
    """Segments strewn in a unit cube, as OBJ."""
    numbers = random.Random(seed)
    with path.open("w") as file:
        for line in range(count):
            start = [numbers.random() for _ in range(3)]
            end = [x + numbers.uniform(-0.05, 0.05) for x in start]
            for x, y, z in (start, end):
                file.write(f"v {x:.6f} {y:.6f} {z:.6f}\n")
            file.write(f"l {2 * line + 1} {2 * line + 2}\n")


def eval_of_lines(place, size, _neat):
    write_lines(place / "a.obj", size, 1)
    write_lines(place / "b.obj", size, 2)
    return ["eval", "--pred", place / "a.obj", "--gt", place / "b.obj"]


def batch(place, size, neat):
    scene = place / "scene"
    words = ["synth", "--out", scene, "--views", 3, "--image-size", 32, "--quiet"]
    subprocess.run([str(word) for word in [neat, *words]], check=True, capture_output=True)
    jobs = "".join(f'[[job]]\nscene = "scene"\nname = "job-{job}"\n' for job in range(size))
    (place / "scenes.toml").write_text(jobs)
    return ["batch", place / "scenes.toml", "--out", place / "out", "--dry-run"]


def colmap(place, size, lines_of_points, images_there):
    model = place / "sparse" / "0"
    model.mkdir(parents=True)
    (place / "images").mkdir()
    # The smallest PNG: one grey pixel.
    pixel = bytes.fromhex(
        "89504e470d0a1a0a0000000d4948445200000001000000010800000000"
        "3a7e9b550000000a49444154789c63680000008200 8177cd72b6"
        "0000000049454e44ae426082".replace(" ", "")
    )
    (model / "cameras.txt").write_text("1 PINHOLE 1 1 1 1 0.5 0.5\n")
    with (model / "images.txt").open("w") as file:
        for image in range(images_there or size):
            file.write(f"{image + 1} 1 0 0 0 {image} 0 5 1 {image}.png\n\n")
            if images_there:
                (place / "images" / f"{image}.png").write_bytes(pixel)
    with (model / "points3D.txt").open("w") as file:
        for point in range(lines_of_points):
            file.write(f"{point + 1} {point % 97} {point % 89} 9 0 0 0 0.5 1 0 2 0 3 0\n")
    return ["info", place]


ROWS = [
    ("`eval`, neat-abc, lines on both sides", 250, eval_of_lines),
    ("`eval --matching per-threshold`", 2000, lambda *of: [*eval_of_lines(*of), "--matching", "per-threshold"]),
    ("`batch --dry-run`, jobs", 2500, batch),
    ("`info`, COLMAP points", 50_000, lambda place, size, _: colmap(place, size, size, 8)),
    ("`info`, COLMAP images that are not there", 50_000, lambda place, size, _: colmap(place, size, 0, 0)),
]  # fmt: skip


if __name__ == "__main__":
    main()
