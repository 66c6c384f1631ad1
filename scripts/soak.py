#!/usr/bin/env python3
"""Spoils scenes, options, limits and moments by a seed, and looks at how neat takes it.

    scripts/soak.py                                  one minute
    scripts/soak.py --seconds 28800 --seed 7         a night
    scripts/soak.py --seed 7 --case 123              one case again

Each case makes a copy of a small synthetic scene in one of three formats, spoils files of it,
and runs a command with options that may be wrong, under limits that may be tight, or with a
signal at a random moment. Whatever happens:

- the exit code is one of docs/reliability.md, and no signal but ours ends the program;
- nobody reads of a panic, and nothing that a terminal would obey is printed;
- what fails has exactly one line that begins with `error: `;
- no case takes more memory than small scenes need, or many times the time of a plain run at that
  moment: a busy machine is no finding;
- exit code 0 of a reconstruction comes with a valid wireframe that has edges, 3 with an
  empty one;
- what was interrupted or killed goes on with --resume, to the bytes of a run that nobody
  disturbed (but for checkpoints that an interrupt added).

The exit code is 1 if a case broke one of these; its folder is kept and its command printed.
Needs Python 3.9 on Linux or macOS, and nothing else.
"""

import argparse
import collections
import dataclasses
import json
import math
import os
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

KNOWN_CODES = {0, 1, 2, 3, 130}
# A case that takes so many times as long as a plain run does at that moment is stuck: two minutes
# where a plain run takes a second.
PATIENCE_IN_RUNS = 120
MOST_MEMORY_IN_MIB = 2048
# They hold times.
WITH_TIMES = {"manifest.json", "report.html"}
NUMBERS = ["nan", "inf", "-1", "0", "1e308", "-1e308", "1e-308", "4294967296", "1e9", "0.5", "x", ""]
NAMES = ["..", "a b", "\x1b[2J", "\u202e", "", "con", "x" * 300, "../../x", "ä"]
SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]
SETTINGS = [
    "detect.min_gradient", "detect.texture_factor", "detect.min_score", "data.min_segment_score",
    "distill.assembler.min_evidence", "distill.assembler.neighbours",
    "distill.assembler.ball_margin", "distill.assembler.min_segment_length_in_pixels",
    "distill.assembler.refine_poses", "distill.confidence.tolerance_in_pixels", "train.rays",
]  # fmt: skip


def main():
    arguments = parsed()
    work = pathlib.Path(tempfile.mkdtemp(prefix="neat-soak-"))
    scenes = base_scenes(arguments.neat, work)
    yardstick = Yardstick(arguments.neat, scenes[0], work)
    end = time.monotonic() + arguments.seconds
    codes, findings, case = collections.Counter(), 0, arguments.case or 0
    while time.monotonic() < end:
        soaked = Case(arguments, case, scenes, yardstick, work / f"case-{case}")
        broken = soaked.run()
        codes[soaked.code] += 1
        if broken:
            findings += 1
            print(f"case {case} (seed {arguments.seed}): {broken}\n  {soaked.told()}", flush=True)
        else:
            shutil.rmtree(soaked.folder)
        case += 1
        if arguments.case is not None:
            break
    counted = ", ".join(f"{count} × {code}" for code, count in sorted(codes.items()))
    print(f"{sum(codes.values())} cases, exit codes {counted}; broken promises: {findings}")
    if not findings:
        shutil.rmtree(work)
    sys.exit(1 if findings else 0)


def parsed():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--neat", default="target/release/neat", help="the program")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", type=int, help="this one alone")
    arguments = parser.parse_args()
    arguments.neat = str(pathlib.Path(arguments.neat).resolve())
    return arguments


def base_scenes(neat, work):
    """Scenes without faults: one of each kind of format, with 2D wireframes and without."""

    def call(*words):
        subprocess.run([neat, *map(str, words), "--quiet"], check=True, capture_output=True)

    npz, colmap, transforms = work / "npz", work / "colmap", work / "transforms"
    call("synth", "--out", npz, "--views", 8, "--image-size", 64, "--detection-rate", 1)
    call("convert", npz, "--out", colmap, "--to", "colmap")
    call("convert", npz, "--out", transforms, "--to", "transforms-json")
    shutil.rmtree(transforms / "hawp", ignore_errors=True)
    return [npz, colmap, transforms]


class Yardstick:
    """How long a plain run takes on this machine, as busy as it is."""

    def __init__(self, neat, scene, work):
        out = work / "yardstick"
        self.command = [neat, "reconstruct", scene, "--out", out, "--overwrite", "--quiet"]
        self.command += ["--train", "--backend", "flex", "--steps", "20"]
        self.environment = {**os.environ, "XDG_CACHE_HOME": str(work / "yardstick-cache")}
        self.seconds = self.measured()

    def measured(self):
        began = time.monotonic()
        words = [str(word) for word in self.command]
        subprocess.run(words, check=True, capture_output=True, env=self.environment)
        return time.monotonic() - began

    def allows(self, seconds):
        """Whether a case may take so long. It is asked again before it says no."""
        if seconds > PATIENCE_IN_RUNS * self.seconds:
            self.seconds = self.measured()
        return seconds <= PATIENCE_IN_RUNS * self.seconds


@dataclasses.dataclass
class Ended:
    """How a program ended."""

    code: int
    stderr: str
    stdout: str
    mebibytes: float
    timed_out: bool


class Case:
    """One command on one scene, which the seed decides."""

    def __init__(self, arguments, number, scenes, yardstick, folder):
        self.neat, self.yardstick, self.folder = arguments.neat, yardstick, folder
        self.random = random.Random(f"{arguments.seed}-{number}")
        self.scene, self.out = folder / "scene", folder / "out"
        shutil.copytree(self.random.choice(scenes), self.scene)
        self.faults = [self.spoil() for _ in range(self.random.choice([0, 0, 0, 1, 1, 3]))]
        self.command = self.some_command()
        self.limits = self.some_limits()
        self.signal = self.random.choice(SIGNALS) if self.random.random() < 0.25 else None
        self.code = None

    def told(self):
        return f"{' '.join(self.command)}\n  faults: {self.faults}, limits: {self.limits}, {self.signal}"

    # What may be wrong.

    def spoil(self):
        """Spoils a file of the scene; returns what was done."""
        files = sorted(path for path in self.scene.rglob("*") if path.is_file())
        if not files:
            return "no file"
        # Files of poses are few and images many.
        small = [path for path in files if path.suffix not in (".png", ".jpg")]
        path = self.random.choice(small if small and self.random.random() < 0.6 else files)
        other = self.random.choice(files)
        done = self.random.choice(
            ["bits", "cut", "grown", "empty", "number", "number", "line", "gone", "other", "folder", "loop", "name"]
        )  # fmt: skip
        content = path.read_bytes()
        if done == "bits":
            changed = bytearray(content)
            for _ in range(self.random.choice([1, 4, 64])):
                if changed:
                    changed[self.random.randrange(len(changed))] ^= 1 << self.random.randrange(8)
            path.write_bytes(changed)
        elif done == "cut":
            path.write_bytes(content[: self.random.randrange(len(content) + 1)])
        elif done == "grown":
            path.write_bytes(content + content[: self.random.randrange(len(content) + 1)])
        elif done == "empty":
            path.write_bytes(b"")
        elif done == "number":
            words = content.split(b" ")
            value = self.random.choice(NUMBERS).encode()
            words[self.random.randrange(len(words))] = value
            path.write_bytes(b" ".join(words))
        elif done == "line":
            lines = content.splitlines(keepends=True)
            self.random.shuffle(lines)
            path.write_bytes(b"".join(lines[self.random.randrange(2) :]))
        elif done == "gone":
            path.unlink()
        elif done == "other":
            path.write_bytes(other.read_bytes())
        elif done == "folder":
            path.unlink()
            path.mkdir()
        elif done == "loop":
            path.unlink()
            path.symlink_to(path.name)
        elif done == "name":
            name = self.random.choice(NAMES).replace("/", "_").strip(".")[:200]
            path.rename(path.with_name(name + path.suffix if name else path.name + "~"))
        return f"{done} {path.relative_to(self.scene)}"

    def some_command(self):
        scene, out = str(self.scene), str(self.out)
        word = self.random.choice(["reconstruct"] * 5 + ["train", "info", "doctor", "detect", "convert", "eval"])
        if word == "reconstruct":
            command = [word, scene, "--out", out, *self.some_options()]
            if self.random.random() < 0.2:
                # Drivers of GPUs, which `auto` would ask, end programs under a limit on files.
                steps = self.random.choice(["3", "20", "0", "-1"])
                command += ["--train", "--backend", "flex", "--steps", steps]
            return command
        if word == "train":
            return [word, scene, "--out", out, "--steps", "5", "--backend", "flex"]
        if word == "convert":
            to = self.random.choice(["colmap", "cameras-npz", "transforms-json", "what"])
            return [word, scene, "--out", out, "--to", to]
        if word == "detect":
            return [word, scene, "--out", out]
        if word == "eval":
            return [word, str(self.random.choice(sorted(self.scene.rglob("*")) or [self.scene])), "--scene", scene]
        return [word, scene]

    def some_options(self):
        number = self.random.choice(NUMBERS)
        sphere = ",".join(self.random.choice([*NUMBERS, "0", "0"]) for _ in range(4))
        choices = [
            ["--set", f"{self.random.choice(SETTINGS)}={number}"],
            ["--max-views", number],
            ["--max-image-size", self.random.choice([number, "32", "7"])],
            ["--threads", self.random.choice([number, "1", "3"])],
            ["--scene-sphere", sphere],
            ["--memory-limit", self.random.choice(["1", "10MiB", "1GiB", number])],
            ["--focal-scale", number],
            ["--poses", "world-to-camera"],
            ["--mirrored-world"],
            ["--no-doctor"],
            ["--seed", number],
        ]
        picked = self.random.sample(choices, self.random.choice([0, 0, 0, 1, 2]))
        return [word for option in picked for word in option]

    def some_limits(self):
        """Limits of the system, by name."""
        if self.random.random() < 0.8:
            return {}
        return self.random.choice(
            [
                {"RLIMIT_FSIZE": self.random.choice([0, 1000, 30_000])},
                {"RLIMIT_NOFILE": self.random.choice([4, 8, 16, 40])},
                {"RLIMIT_CORE": 0},
            ]
        )

    # What neat does.

    def run(self):
        """Runs it; returns what was broken."""
        moment = self.random.uniform(0.0, 0.6) if self.signal else None
        ended = self.start(self.command, self.limits, moment)
        self.code = ended.code
        broken = self.broken(ended)
        if broken or self.command[0] != "reconstruct":
            return broken
        if ended.code in (0, 3):
            return self.broken_result(ended.code)
        interrupted = ended.code == 130 or (self.signal == signal.SIGKILL and ended.code == -9)
        return self.broken_resume() if interrupted else None

    def start(self, command, limits=None, moment=None):
        limits = limits or {}

        def limit():
            for name, value in limits.items():
                resource.setrlimit(getattr(resource, name), (value, value))

        # Pipes: a limit on the size of files would be one on messages, too.
        child = subprocess.Popen(
            [self.neat, *command],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            preexec_fn=limit, env={**os.environ, "XDG_CACHE_HOME": str(self.folder / "cache")},
        )  # fmt: skip
        with ThreadPoolExecutor() as readers, child.stdout, child.stderr:
            texts = [readers.submit(pipe.read) for pipe in (child.stdout, child.stderr)]
            code, usage, timed_out = waited(child.pid, moment, self.signal, self.yardstick)
            said, errors = (text.result().decode(errors="replace") for text in texts)
        child.returncode = code
        # Kibibytes on Linux, bytes on macOS.
        scale = 1 << 20 if sys.platform == "darwin" else 1 << 10
        return Ended(code, errors, said, usage.ru_maxrss / scale, timed_out)

    def broken(self, ended):
        """What is wrong with the end of a program, if anything is."""
        killed = self.signal == signal.SIGKILL and ended.code == -signal.SIGKILL
        # Before the program listens to signals.
        early = self.signal is not None and ended.code == -self.signal
        text = ended.stdout + ended.stderr
        if ended.timed_out:
            return f"it ran for as long as {PATIENCE_IN_RUNS} plain runs"
        if not (ended.code in KNOWN_CODES or killed or early):
            return f"exit code {ended.code}: {text[-300:]!r}"
        if "panicked" in text or "RUST_BACKTRACE" in text:
            return f"a panic: {text[-300:]!r}"
        if any(ord(c) < 32 and c not in "\n\t" or 0x7F <= ord(c) < 0xA0 for c in text):
            return f"a control character: {text[-300:]!r}"
        errors = sum(line.startswith("error: ") for line in ended.stderr.splitlines())
        if ended.code > 0 and errors != 1:
            return f"exit code {ended.code} with {errors} errors: {ended.stderr[-300:]!r}"
        if ended.mebibytes > MOST_MEMORY_IN_MIB:
            return f"it took {ended.mebibytes:.0f} MiB"
        return None

    def broken_result(self, code):
        """What is wrong with a wireframe that was written, if anything is."""
        try:
            document = json.loads((self.out / "wireframe.json").read_text())
            junctions, edges = document["junctions"], document["edges"]
        except (OSError, ValueError, KeyError) as error:
            return f"exit code {code} without a wireframe: {error}"
        if not all(math.isfinite(value) for point in junctions for value in point):
            return "a junction is not finite"
        if not all(0 <= end < len(junctions) for edge in edges for end in edge):
            return "an edge names no junction"
        if (code == 0) != bool(edges):
            return f"exit code {code} with {len(edges)} edges"
        return None

    def broken_resume(self):
        """Resumes, and compares with a run that nobody disturbed."""
        self.signal = None
        resumed = self.start([*self.command, "--resume"])
        again = self.folder / "again"
        reference = self.start([str(again) if word == str(self.out) else word for word in self.command])
        broken = self.broken(resumed) or self.broken(reference)
        if broken:
            return f"after the signal, {broken}"
        if resumed.code != reference.code:
            return f"resumed: exit code {resumed.code}, not {reference.code}: {resumed.stderr[-300:]!r}"
        expected, found = files(again), files(self.out)
        different = [name for name in expected if found.get(name) != expected[name]]
        # What an interrupt saved on its way out stays.
        added = [name for name in found.keys() - expected if not name.startswith("checkpoints/")]
        if reference.code in (0, 3) and (different or added):
            return f"resumed, other files: {sorted(different + added)}"
        return None


def waited(process, moment, with_signal, yardstick):
    """Waits for a child, sends a signal at a moment; exit code, usage, whether it was stuck."""
    began = time.monotonic()
    sent, stuck = moment is None, False
    while True:
        done, status, usage = os.wait4(process, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), usage, stuck
        passed = time.monotonic() - began
        if not sent and passed >= moment:
            os.kill(process, with_signal)
            sent = True
        if not stuck and not yardstick.allows(passed):
            os.kill(process, signal.SIGKILL)
            stuck = True
        time.sleep(0.002)


def files(folder):
    """The files of a run that hold no times: contents by name."""
    paths = (path for path in folder.rglob("*") if path.is_file() and path.name not in WITH_TIMES)
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


if __name__ == "__main__":
    main()
