#!/usr/bin/env python3
"""Which kernels a training step on a GPU launches, how often and for how long.

CubeCL logs every kernel that it runs, one after the other, where its environment
variables ask for it. Two trainings that differ by some steps are run so; the
difference of their logs is what those steps did. Times are of kernels that wait for
each other, so they say what is large, not how long a step takes; few steps give exact
counts and poor times.

    scripts/profile_kernels.py SCENE [--neat target/release/neat] [--steps N]
        [-- OPTION...]              options of `neat train`, such as --preset fast

Needs a program built with `--features wgpu` and a GPU, or a software Vulkan driver, which is slow.
"""

import argparse
import collections
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

LINE = re.compile(r"\| ([\d.]+)(ns|µs|ms|s)\s+\| (.*)")
MILLISECONDS = {"ns": 1e-6, "µs": 1e-3, "ms": 1.0, "s": 1e3}
# Kernels of one kind with different operations are told apart by their next word.
FAMILIES = {"KernelBinop", "KernelScalarBinop", "UnaryFloat", "UnaryNumeric"}


def kernel_name(text):
    words = text.strip().split(" | ")
    named = words[:2] if words[0] in FAMILIES else words[:1]
    return re.sub(r"_[0-9a-f]{8}$", "", " ".join(named))


def kernels(neat, scene, steps, options):
    """Launches and milliseconds by kernel, of a training of so many steps."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "kernels.log")
        command = [neat, "train", scene, "--out", Path(folder, "run"), "--backend", "wgpu"]
        environment = {**os.environ, "CUBECL_DEBUG_LOG": log, "CUBECL_DEBUG_OPTION": "profile"}
        subprocess.run(
            [*command, "--steps", str(steps), "--quiet", *options],
            env=environment,
            stdout=subprocess.DEVNULL,
            check=True,
        )
        launches, times = collections.Counter(), collections.Counter()
        with log.open(encoding="utf-8", errors="replace") as lines:
            for match in filter(None, map(LINE.match, lines)):
                number, unit, text = match.groups()
                name = kernel_name(text)
                launches[name] += 1
                times[name] += float(number) * MILLISECONDS[unit]
    return launches, times


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("scene")
    parser.add_argument("--neat", default="target/release/neat")
    parser.add_argument("--steps", type=int, default=4, help="steps that are counted")
    # What follows -- belongs to `neat train`.
    words = sys.argv[1:]
    end = words.index("--") if "--" in words else len(words)
    options = words[end + 1 :]
    arguments = parser.parse_args(words[:end])
    if arguments.steps < 1:
        parser.error("--steps must be positive")

    # A step that asks for no more iterations of the sampler than the one before it.
    warm_up = 4
    steps = [warm_up, warm_up + arguments.steps]
    runs = [kernels(arguments.neat, arguments.scene, count, options) for count in steps]
    (before, before_times), (after, after_times) = runs
    rows = []
    for name in after:
        launches = (after[name] - before[name]) / arguments.steps
        milliseconds = (after_times[name] - before_times[name]) / arguments.steps
        rows.append((launches, milliseconds, name))
    if not rows:
        sys.exit("no kernel was logged: is this a build with the wgpu backend?")
    print("| kernel | launches per step | ms per step |\n| --- | --: | --: |")
    for launches, milliseconds, name in sorted(rows, reverse=True):
        print(f"| {name} | {launches:.1f} | {milliseconds:.2f} |")
    total = [sum(row[i] for row in rows) for i in range(2)]
    print(f"| **all** | **{total[0]:.1f}** | **{total[1]:.2f}** |")


if __name__ == "__main__":
    main()
