#!/usr/bin/env python3
"""Reconstructs objects with a known wireframe and measures the results.

    scripts/measure_objects.py DATA OUT                        seeds 0, 1 and 2, all views
    scripts/measure_objects.py DATA OUT --views 50,25,12       fewer views
    scripts/measure_objects.py DATA OUT --set KEY=VALUE        with another setting
    scripts/measure_objects.py DATA OUT --preset neat          with another preset

DATA holds one folder per object, with gt_wireframe.json; those without straight edges are
left out. HAWP's 2D wireframes are not used, except with --hawp. OUT keeps every run, so that
an interrupted measurement goes on. Prints a Markdown table; OUT/measurements.json holds every
number. Needs Python 3.9 and nothing else.
"""

import argparse
import json
import os
import pathlib
import sys

from measuring import call, f_score, reconstruct, settings


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--neat", default="target/release/neat", help="the program")
    parser.add_argument("--objects", help="names of folders, with commas; all with a truth")
    parser.add_argument("--seeds", default="0,1,2")
    parser.add_argument("--views", default="", help="numbers of views, with commas")
    parser.add_argument("--hawp", action="store_true", help="use HAWP's wireframes")
    parser.add_argument("--preset", default="fast", help="what the runs start from")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--threshold", type=float, default=0.01)
    return parser.parse_args()


def numbers(text):
    return [float(x) for x in text.split(",") if x]


def without_hawp(scene, out):
    """A folder of links to all of a scene but its 2D wireframes."""
    if not (scene / "hawp").exists():
        return scene
    copy = (out / "scenes" / scene.name).absolute()
    copy.mkdir(parents=True, exist_ok=True)
    for entry in scene.iterdir():
        link = copy / entry.name
        if entry.name != "hawp" and not link.exists():
            link.symlink_to(entry.resolve())
    return copy


def run_arguments(options, views):
    arguments = ["--no-doctor", "--preset", options.preset, *settings(options.set)]
    if views:
        arguments += ["--max-views", int(views)]
    return arguments


def evaluate(options, scene, run):
    """F-scores against the full truth and against what the 2D input supports."""
    command = [options.neat, "eval", "--pred", run / "wireframe.json"]
    command += ["--gt", scene / "gt_wireframe.json", "--scene", scene, "--format", "json"]
    command += ["--thresholds", str(options.threshold), "--matching", "per-threshold"]
    full, supported = json.loads(call(*command))
    scores = {}
    for name, report in (("full", full), ("supported", supported)):
        graph = report["scores"]["wireframe"]
        for of, key in (("junctions", "junctions"), ("segments", "segments_max")):
            score = graph[key][0]
            p, r = score["precision"], score["recall"]
            scores[f"{name} {of}"] = {"precision": p, "recall": r, "f": f_score(p, r)}
    return scores


def scenes_with_truth(options):
    # Without a straight edge there is nothing to find, and no score.
    scenes = sorted(
        path.parent
        for path in options.data.glob("*/gt_wireframe.json")
        if json.loads(path.read_text())["lines"]
    )
    if options.objects:
        wanted = options.objects.split(",")
        scenes = [scene for scene in scenes if scene.name in wanted]
    if not scenes:
        sys.exit(f"{options.data}: no folder holds a gt_wireframe.json")
    return scenes


def measure(options):
    with_truth = scenes_with_truth(options)
    results = []
    for views in numbers(options.views) or [None]:
        for original in with_truth:
            scene = original if options.hawp else without_hawp(original, options.out)
            for seed in (int(s) for s in numbers(options.seeds)):
                what = f"{views or 'all'}-views-seed-{seed}"
                run = options.out / "runs" / scene.name / what
                arguments = run_arguments(options, views)
                manifest = reconstruct(options.neat, scene, run, seed, *arguments)
                result = {"object": scene.name, "views": views, "seed": seed}
                result["seconds"] = manifest["seconds"]
                result["scores"] = evaluate(options, scene, run)
                results.append(result)
                print(".", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    (options.out / "measurements.json").write_text(json.dumps(results, indent=1))
    return results


KINDS = ["full junctions", "full segments", "supported junctions", "supported segments"]


def spread(values):
    low, high = min(values), max(values)
    return f"{low:.2f}" if f"{low:.2f}" == f"{high:.2f}" else f"{low:.2f} to {high:.2f}"


def table(results):
    print("| object | views | " + " | ".join(f"F {kind}" for kind in KINDS) + " | seconds |")
    print("| --- | --- |" + " --: |" * (len(KINDS) + 1))
    groups = {}
    for result in results:
        groups.setdefault(result["views"], {}).setdefault(
            result["object"], []
        ).append(result)
    for views, objects in groups.items():
        views = int(views) if views else "all"
        for name, runs in objects.items():
            cells = [spread([run["scores"][kind]["f"] for run in runs]) for kind in KINDS]
            total = spread_seconds([sum(run["seconds"].values()) for run in runs])
            print(f"| {name} | {views} | " + " | ".join(cells) + f" | {total} |")
        f = lambda kind: sum(
            run["scores"][kind]["f"] for runs in objects.values() for run in runs
        ) / sum(len(runs) for runs in objects.values())
        cells = [f"**{f(kind):.3f}**" for kind in KINDS]
        print(f"| **mean** | {views} | " + " | ".join(cells) + " | |")


def spread_seconds(values):
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return f"{low} s" if low == high else f"{low} to {high} s"


def main():
    options = arguments()
    options.out.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("NEAT_CACHE", str((options.out / "cache").absolute()))
    table(measure(options))


if __name__ == "__main__":
    main()
