#!/usr/bin/env python3
"""Measures neat on this machine's GPU, all of it in one call.

    scripts/measure_gpu.py OUT                    synthetic scenes; some ten minutes
    scripts/measure_gpu.py OUT --scene SCENE      the whole run on a scene of yours

One after the other, each into a file of OUT: training steps of the presets beside
the machine's matrix product (bench.json), a whole `fast` reconstruction
with its accuracy where the scene has a truth (run/, reconstruct.txt, eval.txt), how far
the GPU is from the CPU (comparison/), and what a step launches (kernels-PRESET.txt).
A part that fails is named at the end; the others are measured. The program must have been
built with `--features wgpu`.
"""

import argparse
import pathlib
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).parent
# Networks may be narrow where kernels are counted: their number stays.
NARROW = "implicit.width=48 implicit.features=8 rendering.width=16 attraction.width=16".split()


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("out", type=pathlib.Path, help="folder for the results; new")
    parser.add_argument("--neat", default="target/release/neat", help="the program")
    parser.add_argument("--scene", type=pathlib.Path, help="folder of a scene")
    parser.add_argument("--presets", default="fast,paper-abc,paper-dtu", help="steps to measure")
    parser.add_argument("--steps", help="steps of the whole run, instead of the preset's")
    return parser.parse_args()


def measure(name, command, out, failed, ending="txt"):
    """Runs a command, its output into OUT/NAME.ENDING, and says how long it took."""
    command = [str(word) for word in command]
    print(f"{name}: {' '.join(command)}", flush=True)
    start = time.monotonic()
    path = out / f"{name}.{ending}"
    with path.open("w", encoding="utf-8") as file:
        errors = subprocess.STDOUT if ending == "txt" else None
        code = subprocess.run(command, stdout=file, stderr=errors).returncode
    print(f"    {time.monotonic() - start:.1f} s: {path}", flush=True)
    if code != 0:
        failed.append(f"{name} (exit code {code}, {path})")
    return code == 0


def main():
    options = arguments()
    out, neat = options.out, options.neat
    out.mkdir(parents=True)
    failed = []
    bench = [neat, "bench", "--backend", "wgpu", "--preset", options.presets]
    measure("bench", [*bench, "--json"], out, failed, ending="json")

    scene = options.scene or out / "scene"
    if options.scene is None:
        measure("synth", [neat, "synth", "--out", scene], out, failed)
    steps = ["--steps", options.steps] if options.steps else []
    run = [neat, "reconstruct", scene, "--out", out / "run", "--train"]
    done = measure("reconstruct", [*run, "--backend", "wgpu", *steps], out, failed)
    truth = scene / "gt_wireframe.json"
    if done and truth.exists():
        wireframe = out / "run" / "wireframe.json"
        measure("eval", [neat, "eval", "--pred", wireframe, "--gt", truth], out, failed)

    small = out / "small"
    views = ["--views", "12", "--image-size", "128"]
    measure("small", [neat, "synth", "--out", small, *views], out, failed)
    fewer = ["--set", "train.rays=32", "--set", "train.eikonal.uniform_points=32"]
    compare = [neat, "compare-backends", small, "--out", out / "comparison", "--steps", "20"]
    coarse = ["--set", "train.sampler.resolution=16"]
    measure("comparison", [*compare, "--backends", "flex,wgpu", *fewer, *coarse], out, failed)

    profile = [sys.executable, HERE / "profile_kernels.py", small, "--neat", neat, "--steps", "2"]
    narrow = [word for value in NARROW for word in ("--set", f"model.{value}")]
    measure("kernels-fast", [*profile, "--", "--preset", "fast", *fewer, *coarse], out, failed)
    paper = ["--preset", "paper-abc", "--set", "train.rays=4", *narrow]
    measure("kernels-paper-abc", [*profile, "--", *paper], out, failed)

    if failed:
        sys.exit("failed: " + "; ".join(failed))


if __name__ == "__main__":
    main()
