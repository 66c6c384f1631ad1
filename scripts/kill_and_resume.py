#!/usr/bin/env python3
"""Kills reconstructions at random moments, resumes them, and compares the results.

    scripts/kill_and_resume.py                       50 kills
    scripts/kill_and_resume.py --kills 1000 --seed 7 --jobs 4 --threads 1

An uninterrupted reconstruction is the reference. Then `neat` is killed (SIGKILL) again
and again: in runs that are killed once each, and in runs that are killed ten times in a
row. `neat reconstruct ... --resume` must bring each of them to the end with the bytes of
the reference, without a checkpoint lost and without a temporary file left.

Half of the moments are uniform over the time of the reference, half take the stages in
turn, so that short ones are hit too; every fourth kill waits for the next file that is
being written. The seed decides all moments. Prints a Markdown table by the stage in which
the kills fell; the exit code is 1 if anything was not as it must be. Runs that failed are
kept in the folder that the messages name. Needs Python 3.9 and nothing else.

The scene is the toy object abc-00075213 of $NEAT_DATA without its 2D wireframes, so that
they are detected too, or a synthetic one.
"""

import argparse
import bisect
import collections
import dataclasses
import datetime
import hashlib
import itertools
import json
import os
import pathlib
import platform
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor

# A person may look at these; they hold times.
WITH_TIMES = {"manifest.json", "report.html"}
# What follows a stage and is none itself.
AFTERWARDS = {"examine": "set up", "export": "report"}
START = "start"
# Two kinds of failures that are counted.
LOST = "a checkpoint is lost"
LEFT = "was left behind"
# A file that is being written: `.NAME.PROCESS.COUNT.tmp`.
TEMPORARY = re.compile(r"\..+\.\d+\.\d+\.tmp")
CHECKPOINT = re.compile(r"step-(\d{8})\.safetensors")
# Quick, with checkpoints often enough that most kills have one to go on from.
SETTINGS = ("train.checkpoint_interval=10", "train.warm_up_steps=10", "train.rays=128")
# So many kills apart it says how far it is: a thousand take most of an hour.
TOLD_EVERY = 100
# A reconstruction of the toy scene takes some seconds; this one is stuck.
PATIENCE_IN_SECONDS = 600


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--neat", type=pathlib.Path, default="target/release/neat")
    parser.add_argument("--scene", type=pathlib.Path, help="another scene")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--in-a-row", type=int, default=10, help="kills of one run")
    parser.add_argument("--share-in-a-row", type=float, default=0.4, help="of all kills")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--views", type=int, default=12)
    parser.add_argument("--threads", type=int, default=2, help="of a run")
    parser.add_argument("--jobs", type=int, default=1, help="runs at the same time")
    return parser.parse_args()


class Damaged(Exception):
    """A checkpoint that is not whole."""


def check_safetensors(path):
    """Raises Damaged unless the file is as long as its header says."""
    content = path.read_bytes()
    if len(content) < 8:
        raise Damaged(f"{path.name} has {len(content)} bytes")
    end = 8 + int.from_bytes(content[:8], "little")
    try:
        header = json.loads(content[8:end])
    except ValueError as error:
        raise Damaged(f"{path.name} has no header: {error}") from error
    header.pop("__metadata__", None)
    position = 0
    for begin, stop in sorted(tensor["data_offsets"] for tensor in header.values()):
        if begin != position:
            raise Damaged(f"{path.name} has a gap at byte {end + position}")
        position = stop
    if not header or end + position != len(content):
        raise Damaged(f"{path.name} has {len(content)} bytes instead of {end + position}")


def checkpoints(run):
    """Steps of the checkpoints of a run. Raises Damaged if one is not whole."""
    steps = []
    for path in sorted((run / "checkpoints").glob("step-*")):
        if match := CHECKPOINT.fullmatch(path.name):
            check_safetensors(path)
            steps.append(int(match[1]))
    return steps


def is_finished(run):
    """Whether a run has ended: it may have been killed after its last file."""
    try:
        return json.loads((run / "manifest.json").read_text())["status"] == "finished"
    except FileNotFoundError:
        return False


def files(folder):
    """All files below a folder, by their paths in it."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path for path in paths}


def is_temporary(name):
    return TEMPORARY.fullmatch(name.rpartition("/")[2])


def digests(run):
    """SHA-256 of the files of a run; of those with times, only that they are there."""
    return {
        name: "" if name in WITH_TIMES else hashlib.sha256(path.read_bytes()).hexdigest()
        for name, path in files(run).items()
    }


def differences(reference, found):
    """What is not as in the reference, one text per file."""
    for name in sorted(reference.keys() | found.keys()):
        if name not in found:
            yield f"{name} is missing"
        elif name not in reference:
            yield f"{name} {LEFT}" if is_temporary(name) else f"{name} is too many"
        elif found[name] != reference[name]:
            yield f"{name} differs"


@dataclasses.dataclass
class Mark:
    """A stage begins, or ends."""

    time: float
    stage: str


class Session:
    """One process of neat that works on a run."""

    def __init__(self, subject, folder, number):
        self.log = folder / f"log-{number}"
        self.begin = time.time()
        environment = os.environ | {"NEAT_CACHE": str(folder / "cache")}
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [*subject.command, "--out", folder / "run", "--resume", "--progress", "json"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=log,
                env=environment,
            )

    def events(self):
        """What it has told; a kill may have cut the last line off."""
        for line in self.log.read_text(errors="replace").splitlines():
            try:
                event = json.loads(line)
            except ValueError:
                continue
            if isinstance(event, dict):
                yield event

    def marks(self):
        """The parts of the work that have begun, in order."""
        result = [Mark(self.begin, START)]
        for event in self.events():
            stage = None
            if event.get("event") == "stage_started":
                stage = event["stage"]
            elif event.get("event") == "stage_finished":
                stage = AFTERWARDS.get(event["stage"])
            if stage:
                result.append(Mark(event["time"], stage))
        return result

    def continued_after(self):
        """The step of the checkpoint that it went on from; None if it did not (yet)."""
        steps = (event["step"] for event in self.events() if event.get("event") == "resumed")
        return next(steps, None)

    def ended(self):
        return self.process.poll() is not None

    def wait(self):
        """The exit code."""
        return self.process.wait(PATIENCE_IN_SECONDS)

    def kill(self):
        """Whether there was still something to kill."""
        self.process.kill()
        return self.wait() == -signal.SIGKILL


@dataclasses.dataclass
class Moment:
    """When to kill: after a part of a stage, perhaps at the next write after it."""

    stage: str
    seconds: float
    in_a_write: bool


class Subject:
    """What is done again and again, and what must come out."""

    def __init__(self, options, folder):
        self.folder = folder
        self.scene = scene(options, folder)
        self.command = [
            *(options.neat.absolute(), "reconstruct", self.scene, "--backend", "flex", "--train"),
            *("--steps", str(options.steps), "--threads", str(options.threads)),
            *("--max-views", str(options.views), "--max-image-size", "256"),
            *itertools.chain.from_iterable(("--set", setting) for setting in SETTINGS),
        ]
        self.inputs = digests(self.scene)
        session = Session(self, self.new_run("reference"), 0)
        if session.wait() != 0:
            sys.exit(f"error: the reference failed:\n{session.log.read_text()}")
        self.end = time.time()
        self.reference = digests(folder / "reference" / "run")
        self.marks = session.marks()
        wireframe = json.loads((folder / "reference/run/wireframe.json").read_text())
        self.edges = len(wireframe["edges"])
        if not self.edges:
            sys.exit("error: the reference has no edges, equal results would prove nothing")

    def new_run(self, name):
        folder = self.folder / name
        folder.mkdir()
        return folder

    @property
    def seconds(self):
        return self.end - self.marks[0].time

    @property
    def stages(self):
        return [mark.stage for mark in self.marks]

    def duration(self, index):
        ends = [mark.time for mark in self.marks[1:]] + [self.end]
        return ends[index] - self.marks[index].time

    def moments(self, seed):
        """Moments to kill at, without end."""
        generator = random.Random(seed)
        begins = [mark.time for mark in self.marks]
        for number in itertools.count():
            if number % 2:
                index = number // 2 % len(self.marks)
                seconds = generator.random() * self.duration(index)
            else:
                moment = generator.uniform(begins[0], self.end)
                index = bisect.bisect(begins, moment) - 1
                seconds = moment - begins[index]
            yield Moment(self.stages[index], seconds, number % 4 == 3)


def scene(options, folder):
    """The folder of the scene."""
    if options.scene:
        return options.scene.absolute()
    target = folder / "scene"
    data = pathlib.Path(os.environ.get("NEAT_DATA", "../shared/data")) / "abc-00075213"
    if data.is_dir():
        # Without its 2D wireframes: they are detected then.
        target.mkdir()
        shutil.copytree(data / "images", target / "images")
        shutil.copy(data / "cameras.npz", target)
    else:
        neat = [options.neat.absolute(), "synth", "--out", target, "--views", str(options.views)]
        subprocess.run(neat, check=True, stdout=subprocess.DEVNULL)
        shutil.rmtree(target / "hawp")
    return target


def wait_for(moment, session, subject, run):
    """Returns when the moment has come, or the session has ended without it."""
    order = subject.stages
    later = set(order[order.index(moment.stage) :])
    while not session.ended() and session.marks()[-1].stage not in later:
        time.sleep(0.001)
    deadline = time.monotonic() + moment.seconds
    while not session.ended() and time.monotonic() < deadline:
        time.sleep(min(0.001, max(0, deadline - time.monotonic())))
    # Without a pause: a small file is written in less than a millisecond.
    while moment.in_a_write and not session.ended():
        folders = (run, run / "checkpoints", run / "overlays", run / "detections")
        if any(is_temporary(name) for folder in folders for name in names(folder)):
            break


def names(folder):
    try:
        return os.listdir(folder)
    except FileNotFoundError:
        return []


class Outcome:
    """What became of the kills, by the stage in which they fell."""

    COLUMNS = ("kills", "in a write", "resumed anew", "resumed from a checkpoint", "identical")

    def __init__(self):
        self.counts = collections.defaultdict(collections.Counter)
        self.failures = []
        # Of runs that are made at the same time, one counts at a time.
        self.lock = threading.Lock()

    def kills(self):
        return sum(counts["kills"] for counts in self.counts.values())

    def fail(self, folder, text):
        self.failures.append(text)
        print(f"error: {folder}: {text}", file=sys.stderr)

    def add(self, folder, kills, failures):
        """Counts the kills of a run: (stage, in a write, with a checkpoint) of each."""
        with self.lock:
            before = self.kills()
            for stage, in_a_write, with_checkpoint in kills:
                counts = self.counts[stage]
                counts["kills"] += 1
                counts["in a write"] += in_a_write
                counts["resumed from a checkpoint" if with_checkpoint else "resumed anew"] += 1
                counts["identical"] += not failures
            for text in failures:
                self.fail(folder, text)
            if self.kills() // TOLD_EVERY > before // TOLD_EVERY:
                print(f"{self.kills()} kills, {len(self.failures)} failures", file=sys.stderr)

    def count(self, kind):
        return sum(kind in text for text in self.failures)

    def table(self, stages):
        yield "| killed in | " + " | ".join(self.COLUMNS) + " |"
        yield "| --- |" + " ---: |" * len(self.COLUMNS)
        total = sum(self.counts.values(), collections.Counter())
        rows = [(stage, self.counts[stage]) for stage in stages if stage in self.counts]
        for stage, counts in [*rows, ("all", total)]:
            cells = (str(counts[column]) for column in self.COLUMNS)
            yield f"| {stage} | " + " | ".join(cells) + " |"


def one_run(subject, folder, moments, outcome):
    """Kills a run at each of the moments, resumes it after each, and looks at the end."""
    run = folder / "run"
    failures = []
    newest = 0  # step of the last checkpoint that was seen whole
    finished = False
    kills = []
    for number, moment in enumerate([*moments, None]):
        session = Session(subject, folder, number)
        if moment:
            wait_for(moment, session, subject, run)
        killed = moment is not None and session.kill()
        code = session.wait()
        continued = session.continued_after()
        expected = None if finished else newest or None
        if continued != expected and not (killed and continued is None):
            failures.append(f"went on after step {continued}, not {newest}")
        if not killed:
            if code != 0:
                failures.append(f"exit code {code}: {session.log.read_text()[-2000:]}")
            break
        in_a_write = any(is_temporary(name) for name in files(run))
        try:
            steps = checkpoints(run)
        except Damaged as error:
            failures.append(f"{LOST}: {error}")
            steps = []
        if newest > max(steps, default=0):
            failures.append(f"{LOST}: that of step {newest} is gone, {steps} are there")
        newest = max([newest, *steps])
        finished = is_finished(run)
        kills.append((session.marks()[-1].stage, in_a_write, newest > 0))
    failures.extend(differences(subject.reference, digests(run)))
    outcome.add(folder, kills, failures)
    if not failures:
        shutil.rmtree(folder)


def plan(kills, options):
    """How often each of the next runs is killed."""
    in_a_row = round(kills * options.share_in_a_row)
    yield from [1] * (kills - in_a_row)
    while in_a_row > 0:
        yield min(in_a_row, options.in_a_row)
        in_a_row -= options.in_a_row


def main():
    options = arguments()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="neat-kills-"))
    subject = Subject(options, folder)
    outcome = Outcome()
    moments = subject.moments(options.seed)
    begin = time.monotonic()
    number = 0
    with ThreadPoolExecutor(options.jobs) as pool:
        # A run may end before its moment has come: others make up for it.
        while (left := options.kills - outcome.kills()) > 0:
            runs = []
            for count in plan(left, options):
                number += 1
                run = subject.new_run(f"run-{number}")
                moments_of_run = list(itertools.islice(moments, count))
                runs.append(pool.submit(one_run, subject, run, moments_of_run, outcome))
            for run in runs:
                run.result()
    # A run that is finished says so and changes nothing.
    session = Session(subject, folder / "reference", 1)
    if session.wait() != 0 or digests(folder / "reference" / "run") != subject.reference:
        outcome.fail(folder / "reference", f"it was changed: {session.log.read_text()}")
    if digests(subject.scene) != subject.inputs:
        outcome.fail(subject.scene, "the scene was changed")

    print("\n".join(outcome.table(subject.stages)))
    missed = set(subject.stages) - set(outcome.counts)
    print(
        f"\n{outcome.kills()} kills of {number} runs, seed {options.seed}: "
        f"{outcome.count(LOST)} checkpoints lost, {outcome.count(LEFT)} temporary files "
        f"left, {len(outcome.failures)} failures. An uninterrupted run has {subject.edges} "
        f"edges and took {subject.seconds:.1f} s; all took {time.monotonic() - begin:.0f} s on "
        f"{options.threads} threads, {options.jobs} runs at a time ({platform.machine()}, "
        f"{datetime.date.today()})."
    )
    if missed:
        print(f"No kill fell into: {', '.join(sorted(missed))}.")
    if outcome.failures:
        sys.exit(1)
    shutil.rmtree(folder)


if __name__ == "__main__":
    main()
