#!/usr/bin/env python3
"""What each constant of the assembler costs if it is halved and doubled.

    scripts/measure_sensitivity.py OUT SCENE...                  all constants: a night
    scripts/measure_sensitivity.py OUT SCENE... --only NAME ...  some of them
    scripts/measure_sensitivity.py OUT SCENE... --jobs 16        so many values at once

Every `const` of neat-wireframe/src/assemble that is a number, or an array of numbers, is made a
function in a copy of the last commit, which reads its value from the environment: the example
`measure_assembler` is built once, and run on the scenes with one value changed after the other.
The few that other constants are made of are changed in the source, with a build each. Numbers
between 0 and 1 are changed by their odds, so that probabilities, shares and cosines stay what
they are; all others by the factor itself; counts stay whole and above 0.

Scores are grouped by the folders that scenes lie in, as classes. The table says, for each
constant, by how much the mean F of each class changes (segments of objects at 0.01; creases of
photographs, the mean of the three thresholds), the worst first. OUT/results.json keeps what has
been measured: the same command goes on after an interrupt. With several jobs each has one thread,
which is more work in the same time than one job with all of them.

Needs Python 3.9, git and cargo.
"""

import argparse
import collections
import concurrent.futures
import json
import math
import os
import pathlib
import re
import statistics
import subprocess
import sys
import typing

ROOT = pathlib.Path(__file__).resolve().parent.parent
CRATE = pathlib.Path("neat-wireframe/src")
NUMBER = r"-?[0-9][0-9_]*(?:\.[0-9_]*)?(?:e-?[0-9]+)?"
CONSTANT = re.compile(
    rf"^((?:pub(?:\(\w+\))? )?)const ([A-Z0-9_]+): (f64|usize|\[(?:f64|usize); \d+\]) = "
    rf"({NUMBER}|\[(?:\s*{NUMBER},?)+\s*\]);",
    re.M,
)
# Imports, comments and texts: no constant is read in them.
NOT_READ = re.compile(r'^\s*(?:pub(?:\(\w+\))? )?use [^;]*;|//.*|"[^"\n]*"', re.M)
# Where a value has to be known when the program is built.
KNOWN_EARLY = re.compile(
    r"^\s*(?:pub(?:\(\w+\))? )?(?:const|static) [A-Z_]+: (?P<item>[^;=]*(?:;[^=]*)?= [^;]*)"
    r"|; (?P<length>[A-Z_0-9]+)\b|(?P<pattern>[A-Z_0-9]+)(?:\.\.)? =>",
    re.M,
)
READ = """//! Values of constants, from the environment.

/// Those of the constant that is changed.
pub(crate) fn changed<T: std::str::FromStr + Copy, const N: usize>(name: &str, as_it_is: [T; N]) -> [T; N] {
    if std::env::var("NEAT_CONSTANT").is_ok_and(|changed| changed == name) {
        let values = std::env::var("NEAT_VALUES").unwrap();
        let values: Vec<T> = values.split(' ').filter_map(|value| value.parse().ok()).collect();
        return values.try_into().ok().unwrap();
    }
    as_it_is
}
"""
TESTS = "#[cfg(test)]\nmod tests"
FAILED = {"failed": True}
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
    git("checkout", "--quiet", ".", where=copy)
    every = defined(copy)
    chosen = {found.key for found in every if {found.name, found.key} & set(arguments.only)}
    constants = [found for found in every if found.key in chosen or not arguments.only]
    early = known_early(copy)
    made_functions(copy, [found for found in every if found.key not in early])
    changes = [
        (key, found, factor)
        for found in constants
        for factor in (0.5, 2.0)
        if (key := f"{found.key} × {factor}") not in known
    ]
    at_once = [change for change in changes if change[1].key not in early]

    def measure(key, binary, environment):
        print(f"{len(known)} done: {key}", file=sys.stderr, flush=True)
        return key, measured(binary, arguments, environment) if binary else FAILED

    def keep(key, scores):
        known[key] = scores
        results.write_text(json.dumps(known, indent=1))

    if "as it is" not in known or at_once:
        binary = build(copy, out) or sys.exit("with its constants as functions neat does not build")
        # Alone: it leaves the 2D segments that the others read.
        if "as it is" not in known:
            keep(*measure("as it is", binary, {}))
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            measures = [
                pool.submit(measure, key, binary, of_environment(found, factor))
                for key, found, factor in at_once
            ]
            for done in concurrent.futures.as_completed(measures):
                keep(*done.result())
    # Those that need a build each, in the source as it is.
    for key, found, factor in changes:
        if found.key in early:
            git("checkout", "--quiet", ".", where=copy)
            found.path.write_text(with_value(found, changed(found.value, factor)))
            keep(*measure(key, build(copy, out), {}))
    git("worktree", "remove", "--force", copy)
    print(table(known, arguments.scenes))


def parsed():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=pathlib.Path, help="folder for the results")
    parser.add_argument("scenes", type=pathlib.Path, nargs="+", help="scenes with truth")
    parser.add_argument(
        "--only",
        nargs="+",
        default=[],
        metavar="NAME",
        help="these constants, by name or by file and name",
    )
    parser.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="measure so many values at once"
    )
    return parser.parse_args()


def git(*words, where=ROOT):
    subprocess.run(["git", *map(str, words)], cwd=where, check=True, capture_output=True)


class Constant(typing.NamedTuple):
    path: pathlib.Path
    text: str
    visibility: str
    name: str
    kind: str
    value: str

    @property
    def key(self):
        return f"{self.path.relative_to(self.path.parents[1]).as_posix()} {self.name}"


def sources(copy):
    """Those of the assembler, without what only tests are made of."""
    every = sorted((copy / CRATE / "assemble").rglob("*.rs"))
    return [path for path in every if not path.name.startswith("test_")]


def defined(copy):
    """The constants of the assembler."""
    return [
        Constant(path, found[0], *found.groups())
        for path in sources(copy)
        for found in CONSTANT.finditer(path.read_text().split(TESTS)[0])
    ]


def known_early(copy):
    """Keys of those whose values are needed when the program is built."""
    every = defined(copy)
    own = collections.defaultdict(set)
    for found in every:
        own[found.path].add(found.name)
    early = set()
    for path in sources(copy):
        names = set()
        for found in KNOWN_EARLY.finditer(path.read_text()):
            names |= set(re.findall(r"\b[A-Z][A-Z0-9_]+\b", " ".join(filter(None, found.groups()))))
        imported = names - own[path]
        early |= {
            found.key
            for found in every
            if (
                found.name in names
                if found.path == path
                else found.visibility and found.name in imported
            )
        }
    # Other files cannot tell which of two with one name is a function.
    shared = {found.name for found in every if found.visibility and found.key in early}
    return early | {found.key for found in every if found.visibility and found.name in shared}


def made_functions(copy, constants):
    """Constants as functions, and calls of them where they are read."""
    (copy / CRATE / "changed_constants.rs").write_text(READ)
    root = copy / CRATE / "lib.rs"
    root.write_text(root.read_text() + "\nmod changed_constants;\n")
    of_file = collections.defaultdict(dict)
    for found in constants:
        of_file[found.path][found.name] = is_array(found)
    public = {found.name: is_array(found) for found in constants if found.visibility}
    own = collections.defaultdict(set)
    for found in defined(copy):
        own[found.path].add(found.name)
    for path in sources(copy):
        text = path.read_text().split(TESTS)[0]
        for found in constants:
            if found.path == path:
                text = text.replace(found.text, function(found))
        others = {name: array for name, array in public.items() if name not in own[path]}
        path.write_text(calls(text, of_file[path] | others))


def with_value(found, value):
    """The source of a constant's file with another value of it."""
    definition = f"{found.text.removesuffix(found.value + ';')}{value};"
    return found.path.read_text().replace(found.text, definition)


def function(found):
    count = re.findall(NUMBER, found.value)
    kind = re.search("f64|usize", found.kind)[0]
    values = (
        f"static VALUES: std::sync::OnceLock<[{kind}; {len(count)}]> = std::sync::OnceLock::new();"
    )
    first = found.value if is_array(found) else f"[{found.value}]"
    read = f'VALUES.get_or_init(|| crate::changed_constants::changed("{found.key}", {first}))'
    result, read = (f"&'static {found.kind}", read) if is_array(found) else (kind, f"{read}[0]")
    return f"#[allow(non_snake_case)] {found.visibility}fn {found.name}() -> {result} {{ {values} {read} }}"


def is_array(found):
    return found.kind.startswith("[")


def calls(text, names):
    """Where the constants are read; `names` says which of them are arrays."""
    if not names:
        return text
    name = re.compile(rf"\b({'|'.join(sorted(names))})\b(?!\()")
    call = lambda match: f"(*{match[0]}())" if names[match[0]] else f"{match[0]}()"
    parts, end = [], 0
    for skipped in NOT_READ.finditer(text):
        parts += [name.sub(call, text[end : skipped.start()]), skipped[0]]
        end = skipped.end()
    return "".join([*parts, name.sub(call, text[end:])])


def build(copy, out):
    """The example; None where it cannot be built."""
    command = ["cargo", "build", "--locked", "--release", "--quiet", "-p", "neat-eval"]
    command += ["--example", "measure_assembler"]
    target = out / "target"
    done = subprocess.run(
        command,
        cwd=copy,
        env={**os.environ, "CARGO_TARGET_DIR": str(target), "RUSTFLAGS": "-Awarnings"},
    )
    return target / "release/examples/measure_assembler" if done.returncode == 0 else None


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


def of_environment(found, factor):
    values = re.findall(NUMBER, changed(found.value, factor))
    return {"NEAT_CONSTANT": found.key, "NEAT_VALUES": " ".join(values)}


def measured(binary, arguments, environment):
    """F of each scene; that there is none, where the assembler gives up."""
    command = [
        binary,
        "--out",
        arguments.out / "scenes",
        *(scene.resolve() for scene in arguments.scenes),
    ]
    environment = {**os.environ, **environment}
    if arguments.jobs > 1:
        environment["RAYON_NUM_THREADS"] = "1"
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, env=environment)
    return scores(done.stdout) if done.returncode == 0 else FAILED


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
