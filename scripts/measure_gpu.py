#!/usr/bin/env python3
"""Measures neat on this machine's GPU, all of it in one call.

    scripts/measure_gpu.py OUT                      synthetic scenes; some twenty minutes
    scripts/measure_gpu.py OUT --scene SCENE        the whole runs on a scene of yours
    scripts/measure_gpu.py OUT --only bench,neat    some parts alone

One after the other, each into a file of OUT: training steps of the presets beside the
machine's matrix product (bench.json), how far the GPU is from the CPU (comparison/), what a
step launches and for how long (kernels-PRESET.txt), whole runs of `fast` and `neat`, and
`paper-abc` and `paper-dtu` for --minutes each, with their accuracy where the scene has a truth
(PRESET/, eval-PRESET.txt). `paper-dtu` is left out where --dtu names no folder.
A part that fails is named at the end; the others are measured. The program must have been
built with `--features wgpu`.
"""

import argparse
import pathlib
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).parent
PARTS = ["bench", "comparison", "kernels", "fast", "neat", "paper-abc", "paper-dtu"]


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__.split("\n", 1)[0],
        epilog=__doc__.split("\n", 1)[1],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("out", type=pathlib.Path, help="folder for the results")
    parser.add_argument("--neat", default="target/release/neat", help="the program")
    parser.add_argument("--scene", type=pathlib.Path, help="folder of a scene")
    parser.add_argument("--dtu", type=pathlib.Path, help="folder of a DTU scan, for paper-dtu")
    parser.add_argument("--presets", default="fast,neat,paper-abc,paper-dtu", help="steps to measure")
    parser.add_argument("--minutes", type=float, default=8, help="training of the paper's presets")
    parser.add_argument("--only", default=",".join(PARTS), help="parts, with commas: " + ", ".join(PARTS))
    options = parser.parse_args()
    options.only = options.only.split(",")
    unknown = [part for part in options.only if part not in PARTS]
    if unknown:
        parser.error(f"--only: no part {', '.join(unknown)}; there are {', '.join(PARTS)}")
    return options


class Measurement:
    """Commands with their outputs in files of one folder."""

    def __init__(self, out):
        self.out = out
        self.failed = []

    def run(self, name, command, ending="txt"):
        """Runs a command, its output into OUT/NAME.ENDING, and says how long it took."""
        command = [str(word) for word in command]
        print(f"{name}: {' '.join(command)}", flush=True)
        start = time.monotonic()
        path = self.out / f"{name}.{ending}"
        with path.open("w", encoding="utf-8") as file:
            errors = subprocess.STDOUT if ending == "txt" else None
            code = subprocess.run(command, stdout=file, stderr=errors).returncode
        print(f"    {time.monotonic() - start:.1f} s: {path}", flush=True)
        if code != 0:
            self.failed.append(f"{name} (exit code {code}, {path})")
        return code == 0

    def whole_run(self, neat, preset, scene, options):
        """A reconstruction from the field, with its accuracy where there is a truth."""
        run = self.out / preset
        command = [neat, "reconstruct", scene, "--out", run, "--preset", preset, "--train"]
        done = self.run(f"reconstruct-{preset}", [*command, "--backend", "wgpu", *options])
        truth = scene / "gt_wireframe.json"
        if done and truth.exists():
            wireframe = run / "wireframe.json"
            self.run(f"eval-{preset}", [neat, "eval", "--pred", wireframe, "--gt", truth])


def main():
    options = arguments()
    out, neat = options.out, options.neat
    out.mkdir(parents=True, exist_ok=True)
    measurement = Measurement(out)
    parts = set(options.only)

    if "bench" in parts:
        bench = [neat, "bench", "--backend", "wgpu", "--preset", options.presets, "--json"]
        measurement.run("bench", bench, ending="json")

    if parts & {"comparison", "kernels"}:
        small = out / "small"
        views = ["--views", "12", "--image-size", "128"]
        measurement.run("small", [neat, "synth", "--out", small, *views])
        fewer = ["--set", "train.rays=32", "--set", "train.eikonal.uniform_points=32"]
        coarse = ["--set", "train.sampler.resolution=16"]
        if "comparison" in parts:
            compare = [neat, "compare-backends", small, "--out", out / "comparison"]
            compare += ["--steps", "20", "--backends", "flex,wgpu", *fewer, *coarse]
            measurement.run("comparison", compare)
        if "kernels" in parts:
            profile = [sys.executable, HERE / "profile_kernels.py", small, "--neat", neat]
            for preset in options.presets.split(","):
                command = [*profile, "--steps", "4", "--", "--preset", preset]
                measurement.run(f"kernels-{preset}", command)

    scene = options.scene or out / "scene"
    whole = [preset for preset in ("fast", "neat", "paper-abc") if preset in parts]
    if whole and not scene.exists():
        measurement.run("synth", [neat, "synth", "--out", scene])
    budget = ["--time-budget", f"{options.minutes * 60:.0f}s"]
    for preset in whole:
        measurement.whole_run(neat, preset, scene, budget if preset == "paper-abc" else [])
    if "paper-dtu" in parts:
        if options.dtu is None:
            print("paper-dtu: left out, as --dtu names no folder")
        else:
            measurement.whole_run(neat, "paper-dtu", options.dtu, budget)

    if measurement.failed:
        sys.exit("failed: " + "; ".join(measurement.failed))


if __name__ == "__main__":
    main()
