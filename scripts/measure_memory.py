#!/usr/bin/env python3
"""Measures the memory that a reconstruction of many large photographs takes.

    scripts/measure_memory.py OUT                            300 views of 4000×3000 pixels
    scripts/measure_memory.py OUT --views 24 --detect        2D wireframes detected, not given
    scripts/measure_memory.py OUT --views 40 --limit 2GiB

Writes a synthetic scene to OUT/scene (which stays for the next time), reconstructs it
into OUT/run with --memory-limit, and prints the largest resident memory of the process
and the seconds of every stage. The temporary file of the images, as large as they are
decoded (10 GiB for 300 views), lies in OUT/cache while the run lasts. Exit code 1 if the
peak is above the limit. Needs Python 3.9 on Linux or macOS and nothing else.
"""

import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

UNITS = {"KB": 1e3, "MB": 1e6, "GB": 1e9, "KIB": 2**10, "MIB": 2**20, "GIB": 2**30}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--neat", default="target/release/neat", help="the program")
    parser.add_argument("--views", type=int, default=300)
    parser.add_argument("--width", type=int, default=4000)
    parser.add_argument("--height", type=int, default=3000)
    # A small object is quickly rendered, and memory does not depend on its size.
    parser.add_argument("--distance", type=float, default=20.0, help="of the cameras")
    parser.add_argument("--limit", default="8GiB", help="the memory limit")
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--preset", default="fast")
    parser.add_argument("--detect", action="store_true", help="give no 2D wireframes")
    parser.add_argument("--threads", type=int, help="instead of all")
    return parser.parse_args()


def bytes_of(size):
    number, unit = re.fullmatch(r"([0-9.]+)\s*([A-Za-z]+)", size).groups()
    return float(number) * UNITS[unit.upper()]


def make_scene(options, scene):
    """The scene of these numbers, unless it is there."""
    views = list((scene / "images").glob("*.png")) if scene.exists() else []
    if len(views) == options.views and (scene / "cameras.npz").exists():
        return
    shutil.rmtree(scene, ignore_errors=True)
    command = [options.neat, "synth", "--out", scene, "--views", options.views]
    command += ["--image-size", options.width, "--image-height", options.height]
    command += ["--distance", options.distance]
    subprocess.run([str(part) for part in command], check=True)


def without_wireframes(scene, out):
    """A folder of links to all of a scene but its 2D wireframes."""
    copy = out / "scene-without-wireframes"
    copy.mkdir(exist_ok=True)
    for entry in scene.iterdir():
        link = copy / entry.name
        if entry.name != "hawp" and not link.exists():
            link.symlink_to(entry.resolve())
    return copy


def measured(command, environment):
    """Runs a command; returns its exit code and its largest resident memory in bytes."""
    process = subprocess.Popen([str(part) for part in command], env=environment)
    _, status, usage = os.wait4(process.pid, 0)
    unit = 1 if sys.platform == "darwin" else 1024
    return os.waitstatus_to_exitcode(status), usage.ru_maxrss * unit


def main():
    options = arguments()
    out = options.out.absolute()
    out.mkdir(parents=True, exist_ok=True)
    scene = out / "scene"
    make_scene(options, scene)
    if options.detect:
        scene = without_wireframes(scene, out)
    run = out / "run"
    command = [options.neat, "reconstruct", scene, "--out", run, "--overwrite", "--train"]
    command += ["--backend", "flex", "--preset", options.preset, "--steps", options.steps]
    command += ["--memory-limit", options.limit]
    if options.threads:
        command += ["--threads", options.threads]
    cache = out / "cache"
    shutil.rmtree(cache, ignore_errors=True)
    code, peak = measured(command, {**os.environ, "NEAT_CACHE": str(cache)})
    if code != 0:
        sys.exit(f"neat ended with exit code {code}")
    manifest = json.loads((run / "manifest.json").read_text())
    pixels = options.width * options.height
    images = 3 * options.views * pixels
    print(f"{options.views} views of {options.width}×{options.height} pixels, ", end="")
    print(f"{images / 2**30:.2f} GiB decoded; {manifest['threads']} threads")
    print(f"limit {options.limit}, peak {peak / 2**30:.2f} GiB")
    stages = ", ".join(f"{stage} {time:.0f} s" for stage, time in manifest["seconds"].items())
    print(f"{stages} (steps: {manifest['steps']})")
    sys.exit(0 if peak <= bytes_of(options.limit) else 1)


if __name__ == "__main__":
    main()
