#!/usr/bin/env python3
"""Kills batches at random moments, fills their disk, goes on, and compares the results.

    scripts/kill_batch.py                       20 kills
    scripts/kill_batch.py --kills 200 --seed 7

A batch of small synthetic scenes, two at a time, that nobody disturbs is the reference. Other
batches are killed (SIGKILL) ten times each, the program that starts the jobs alone or all
processes of it, at random moments; then the same command brings them to the end. As root on
Linux the folder is a disk in memory, and before every third session a file fills it up and goes
after a second. In the end each run must hold the bytes of the reference and nothing else.

The seed decides all moments. The exit code is 1 if anything was not as it must be, and the
folder is kept. Needs Python 3.9 and nothing else.
"""

import argparse
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from kill_and_resume import differences, digests

SOLIDS = ["l-prism", "wedge", "box", "t-prism"]
KILLS_OF_ONE = 10
# What these scenes need is a tenth of it.
DISK = "64m"
FULL_FOR_SECONDS = 1.0
PATIENCE_IN_SECONDS = 600


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--neat", type=pathlib.Path, default="target/release/neat")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="neat-kill-batch-"))
    subject = Subject(options, folder)
    left, failures, full = options.kills, [], 0
    number = 0
    while left > 0:
        kills = min(left, KILLS_OF_ONE)
        found, filled = subject.disturbed(folder / f"batch-{number}", kills)
        failures += found
        full += filled
        left, number = left - kills, number + 1
        print(f"{left} kills left, {len(failures)} failures", file=sys.stderr)
    for failure in failures:
        print(failure)
    print(
        f"{options.kills} kills of {number} batches, {full} times a full disk, seed {options.seed}: "
        f"{len(failures)} failures. An undisturbed batch took {subject.seconds:.1f} s."
    )
    if not failures:
        shutil.rmtree(folder)
    sys.exit(1 if failures else 0)


class Subject:
    """A batch, and what must come out of it."""

    def __init__(self, options, folder):
        self.random = random.Random(options.seed)
        self.neat, self.scenes = options.neat.absolute(), folder / "scenes"
        for solid in SOLIDS:
            words = ["synth", "--out", self.scenes / solid, "--solid", solid, "--quiet"]
            self.call([*words, "--views", 12, "--image-size", 96, "--detection-rate", 1])
        began = time.monotonic()
        if self.start(folder / "reference", folder / "cache").wait(PATIENCE_IN_SECONDS) != 0:
            sys.exit("the undisturbed batch does not finish")
        self.seconds = time.monotonic() - began
        self.reference = self.results(folder / "reference")

    def call(self, words):
        command = [self.neat, *words]
        subprocess.run([str(word) for word in command], check=True, capture_output=True)

    def start(self, out, cache):
        scenes = [self.scenes / solid for solid in SOLIDS]
        command = [self.neat, "batch", *scenes, "--out", out, "--workers", 2, "--retries", 0]
        command += ["--", "--backend", "flex", "--train", "--steps", 60]
        command += ["--set", "train.checkpoint_interval=10", "--threads", 1]
        return subprocess.Popen(
            [str(word) for word in command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"NEAT_CACHE": str(cache)},
            start_new_session=True,
        )

    def results(self, out):
        """Digests of the files of all runs."""
        return {solid: digests(out / solid / "run") for solid in SOLIDS}

    def disturbed(self, folder, kills):
        """What is not as it must be after so many kills, and how often the disk was full."""
        folder.mkdir()
        is_disk = mounted(folder)
        try:
            return self.disturbed_in(folder, kills, is_disk)
        finally:
            if is_disk:
                subprocess.run(["umount", "--lazy", str(folder)], check=True)

    def disturbed_in(self, folder, kills, is_disk):
        out, full = folder / "out", 0
        for kill in range(kills):
            filler = folder / "filler"
            if is_disk and kill % 3 == 2:
                full += 1
                fill(filler)
            process = self.start(out, folder / "cache")
            if filler.exists():
                time.sleep(FULL_FOR_SECONDS)
                filler.unlink()
            time.sleep(self.random.uniform(0.0, self.seconds))
            whole = self.random.random() < 0.5
            # Jobs that outlive their batch finish, or hold their lock until they are killed.
            (os.killpg if whole else os.kill)(process.pid, signal.SIGKILL)
            process.wait(PATIENCE_IN_SECONDS)
            if not whole and self.random.random() < 0.5:
                end_group(process.pid)
        # Jobs of the last kill may still be at work: their locks say so, and they finish.
        for _ in range(30):
            code = self.start(out, folder / "cache").wait(PATIENCE_IN_SECONDS)
            if code == 0:
                break
            time.sleep(1.0)
        if code != 0:
            return [f"{out}: exit code {code}"], full
        found = self.results(out)
        failures = [
            f"{out / solid}: {text}"
            for solid in SOLIDS
            for text in differences(self.reference[solid], found[solid])
        ]
        summary = json.loads((out / "summary.json").read_text())
        if (jobs := len(summary.get("jobs", SOLIDS))) != len(SOLIDS):
            failures.append(f"{out}: a summary of {jobs} jobs")
        return failures, full


def end_group(group):
    """Kills what is left of a process group."""
    try:
        os.killpg(group, signal.SIGKILL)
    except ProcessLookupError:
        pass


def mounted(folder):
    """Whether the folder has become a small disk in memory."""
    if not sys.platform.startswith("linux") or os.geteuid() != 0:
        return False
    words = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", str(folder)]
    return subprocess.run(words, capture_output=True).returncode == 0


def fill(path):
    """Takes all that is free on the disk, to the last page."""
    with path.open("wb", buffering=0) as file:
        try:
            while file.write(bytes(1 << 16)):
                pass
        except OSError:
            pass


if __name__ == "__main__":
    main()
