#!/usr/bin/env python3
"""What each constant of the assembler costs if it is halved and doubled.

    scripts/measure_sensitivity.py OUT SCENE...                  all constants: a night
    scripts/measure_sensitivity.py OUT SCENE... --only NAME ...  some of them

Every `const` of neat-wireframe/src/assemble that is a number, or an array of numbers, is changed
in a copy of the last commit, the example `measure_assembler` is built there and run on the
scenes. Numbers between 0 and 1 are changed by their odds, so that probabilities, shares and
cosines stay what they are; all others by the factor itself; counts stay whole and above 0.

Scores are grouped by the folders that scenes lie in, as classes. The table says, for each
constant, by how much the mean F of each class changes (segments of objects at 0.01; creases of
photographs, the mean of the three thresholds), the worst first. OUT/results.json keeps what has
been measured: the same command goes on after an interrupt.

Needs Python 3.9, git and cargo.
"""

import argparse
import collections
import json
import math
import os
import pathlib
import re
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCES = "neat-wireframe/src/assemble"
NUMBER = r"-?[0-9][0-9_]*(?:\.[0-9_]*)?(?:e-?[0-9]+)?"
CONSTANT = re.compile(
    rf"^const ([A-Z0-9_]+): (f64|usize|\[(?:f64|usize); \d+\]) = ({NUMBER}|\[[^\]]*\]);", re.M
)
OBJECT = re.compile(r"^(\S+) +segments [\d.]+/[\d.]+/([\d.]+)")
PHOTOGRAPHS = re.compile(r"^(\S+) +P/R/F((?: [\d.]+/[\d.]+/[\d.]+)+)")


def main():
    arguments = parsed()
    out = arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    copy, results = out / "source", out / "results.json"
    if not copy.exists():
        git("worktree", "add", "--detach", copy, "HEAD")
    known = json.loads(results.read_text()) if results.exists() else {}
    wanted = [("as it is", None, None, None)]
    for path in sorted((copy / SOURCES).glob("*.rs")):
        for found in CONSTANT.finditer(path.read_text()):
            if not arguments.only or found[1] in arguments.only:
                wanted += [(f"{path.name} {found[1]}", path, found, f) for f in (0.5, 2.0)]
    for number, (name, path, found, factor) in enumerate(wanted, 1):
        key = name if factor is None else f"{name} × {factor}"
        if key in known:
            continue
        print(f"{number} of {len(wanted)}: {key}", file=sys.stderr, flush=True)
        known[key] = measured(arguments.scenes, copy, out, path, found, factor)
        results.write_text(json.dumps(known, indent=1))
    git("worktree", "remove", "--force", copy)
    print(table(known, arguments.scenes))


def parsed():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=pathlib.Path, help="folder for the results")
    parser.add_argument("scenes", type=pathlib.Path, nargs="+", help="scenes with truth")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="these constants")
    return parser.parse_args()


def git(*words):
    subprocess.run(["git", *map(str, words)], cwd=ROOT, check=True, capture_output=True)


def changed(text, factor):
    """The constant's value times a factor, as Rust reads it."""

    def one(match):
        digits = match[0].replace("_", "")
        if not re.search(r"[.e]", digits):
            return str(max(1, round(int(digits) * factor)))
        value = float(digits)
        if 0 < value < 1:
            odds = factor * value / (1 - value)
            value = odds / (1 + odds)
        else:
            value *= factor
        return repr(value)

    return re.sub(NUMBER, one, text)


def measured(scenes, copy, out, path, found, factor):
    """F of each scene with one constant changed; a reason where there is none."""
    original = path.read_text() if path else None
    if path:
        begin, end = found.span(3)
        path.write_text(original[:begin] + changed(found[3], factor) + original[end:])
    command = ["cargo", "run", "--locked", "--release", "--quiet", "-p", "neat-eval"]
    command += ["--example", "measure_assembler", "--", "--out", out / "scenes"]
    command += [scene.resolve() for scene in scenes]
    try:
        done = subprocess.run(
            [*map(str, command)],
            cwd=copy, capture_output=True, text=True,
            env={**os.environ, "CARGO_TARGET_DIR": str(out / "target")},
        )  # fmt: skip
    finally:
        if path:
            path.write_text(original)
    if done.returncode != 0:
        return {"failed": done.stderr.strip().splitlines()[-1:]}
    return scores(done.stdout)


def scores(text):
    found = {}
    for line in text.splitlines():
        if match := OBJECT.match(line):
            found[match[1]] = float(match[2])
        elif match := PHOTOGRAPHS.match(line):
            found[match[1]] = statistics.mean(
                float(triple.split("/")[2]) for triple in match[2].split()
            )
    return found


def table(known, scenes):
    classes = collections.defaultdict(list)
    for scene in scenes:
        scene = scene.resolve()
        classes[scene.parent.name].append(scene.name)
    base = known["as it is"]

    def mean(found, names):
        of_class = [found[name] for name in names if name in found]
        return statistics.mean(of_class) if of_class else math.nan

    def means(found):
        return [mean(found, names) for names in classes.values()]

    rows = []
    before = means(base)
    for key, found in known.items():
        if key == "as it is":
            continue
        if "failed" in found:
            rows.append((0.0, f"| `{key}` | {' | '.join('–' for _ in classes)} |"))
            continue
        changes = [after - b for after, b in zip(means(found), before)]
        cells = " | ".join(f"{change:+.3f}" for change in changes)
        rows.append((min(changes), f"| `{key}` | {cells} |"))
    head = f"| constant | {' | '.join(classes)} |\n|---|{'--:|' * len(classes)}"
    first = " | ".join(f"{of_class:.3f}" for of_class in before)
    return "\n".join([head, f"| as it is | {first} |", *(row for _, row in sorted(rows))])


if __name__ == "__main__":
    main()
