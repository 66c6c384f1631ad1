#!/usr/bin/env python3
"""Reconstructs objects with a known wireframe and measures the results.

    scripts/measure_objects.py DATA OUT                        seeds 0, 1 and 2, all views
    scripts/measure_objects.py DATA OUT --views 50,25,12       fewer views
    scripts/measure_objects.py DATA OUT --budgets 1,2,4,8      quality over training time
    scripts/measure_objects.py DATA OUT --refinement           what graph refinement is worth
    scripts/measure_objects.py DATA OUT --set KEY=VALUE        with another setting

DATA holds one folder per object, with gt_wireframe.json; those without straight edges are
left out. HAWP's 2D wireframes are not used, except with --hawp. OUT keeps every run, so that
an interrupted measurement goes on. Prints a Markdown table; OUT/measurements.json holds every
number. Needs Python 3.9 and nothing else; --plot FILE.svg draws the mean F-scores over the
training time.
"""

import argparse
import json
import math
import os
import pathlib
import shutil
import statistics
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
    parser.add_argument("--budgets", default="", help="seconds of training, with commas")
    parser.add_argument("--hawp", action="store_true", help="use HAWP's wireframes")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--threshold", type=float, default=0.01)
    parser.add_argument(
        "--refinement",
        action="store_true",
        help="distil every run again without refinement, and without each of its steps",
    )
    parser.add_argument("--plot", type=pathlib.Path)
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


def run_arguments(options, views, budget):
    arguments = ["--no-doctor", *settings(options.set)]
    if views:
        arguments += ["--max-views", int(views)]
    if budget:
        # More steps than the budget leaves time for: the schedule follows the time.
        arguments += ["--time-budget", f"{budget}s", "--set", "train.steps=1000000"]
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
    settings = [(views, None) for views in numbers(options.views)]
    settings += [(None, budget) for budget in numbers(options.budgets)]
    results = []
    for views, budget in settings or [(None, None)]:
        for original in with_truth:
            scene = original if options.hawp else without_hawp(original, options.out)
            for seed in (int(s) for s in numbers(options.seeds)):
                what = f"{views or 'all'}-views-{budget or 'full'}-budget-seed-{seed}"
                run = options.out / "runs" / scene.name / what
                arguments = run_arguments(options, views, budget)
                manifest = reconstruct(options.neat, scene, run, seed, *arguments)
                result = {"object": scene.name, "views": views, "budget": budget, "seed": seed}
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
    print("| object | views | training | " + " | ".join(f"F {kind}" for kind in KINDS) + " | all |")
    print("| --- | --- | --: |" + " --: |" * (len(KINDS) + 1))
    groups = {}
    for result in results:
        groups.setdefault((result["views"], result["budget"]), {}).setdefault(
            result["object"], []
        ).append(result)
    means = []
    for (views, budget), objects in groups.items():
        views = int(views) if views else "all"
        for name, runs in objects.items():
            cells = [spread([run["scores"][kind]["f"] for run in runs]) for kind in KINDS]
            train = spread_seconds([run["seconds"].get("train", 0.0) for run in runs])
            total = spread_seconds([sum(run["seconds"].values()) for run in runs])
            print(f"| {name} | {views} | {train} | " + " | ".join(cells) + f" | {total} |")
        f = lambda kind: sum(
            run["scores"][kind]["f"] for runs in objects.values() for run in runs
        ) / sum(len(runs) for runs in objects.values())
        cells = [f"**{f(kind):.3f}**" for kind in KINDS]
        print(f"| **mean** | {views} | {budget or ''} | " + " | ".join(cells) + " | |")
        means.append((views, budget, [f(kind) for kind in KINDS]))
    return means


def spread_seconds(values):
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return f"{low} s" if low == high else f"{low} to {high} s"


def plot(means, path):
    """The mean F-scores over the training time as SVG."""
    points = sorted((budget, f) for _, budget, f in means if budget)
    if len(points) < 2:
        sys.exit("--plot needs two budgets or more")
    width, height, left, bottom, top, right = 640, 360, 56, 48, 16, 190
    largest = max(budget for budget, _ in points)
    x = lambda t: left + (width - left - right) * t / largest
    y = lambda f: height - bottom - (height - bottom - top) * f
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="sans-serif" font-size="12">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for f in (0, 0.25, 0.5, 0.75, 1):
        lines.append(f'<path d="M{left} {y(f):.1f}H{width - right}" stroke="#ddd"/>')
        lines.append(f'<text x="{left - 8}" y="{y(f) + 4:.1f}" text-anchor="end">{f}</text>')
    for budget, _ in points:
        lines.append(
            f'<text x="{x(budget):.1f}" y="{height - bottom + 18}" '
            f'text-anchor="middle">{budget:g}</text>'
        )
    middle = (left + width - right) / 2
    lines.append(
        f'<text x="{middle:.0f}" y="{height - 10}" text-anchor="middle">'
        "seconds of training</text>"
    )
    colors = ["#0072b2", "#d55e00", "#56b4e9", "#e69f00"]
    for index, (kind, color) in enumerate(zip(KINDS, colors)):
        path_data = "L".join(f"{x(t):.1f} {y(f[index]):.1f}" for t, f in points)
        dash = ' stroke-dasharray="6 4"' if index > 1 else ""
        lines.append(f'<path d="M{path_data}" fill="none" stroke="{color}" stroke-width="2"{dash}/>')
        row = top + 16 + 20 * index
        lines.append(
            f'<path d="M{width - right + 12} {row - 4}h24" stroke="{color}" '
            f'stroke-width="2"{dash}/>'
        )
        lines.append(f'<text x="{width - right + 42}" y="{row}">F {kind}</text>')
    path.write_text("\n".join(lines + ["</svg>\n"]))


# Runs of one trained field, by what distillation leaves out.
WITHOUT = {
    "refined": [],
    "without adjustment": ["bundle_adjustment"],
    "without re-triangulation": ["retriangulation", "junction_splitting"],
    "unrefined": ["retriangulation", "junction_splitting", "bundle_adjustment"],
}
# A found junction farther away is another one, whatever the run; in world units.
MAX_JUNCTION_ERROR = 0.1
REFINEMENT_THRESHOLDS = [0.01, 0.005]


def measure_refinement(options, scenes):
    """Every trained run with ever less refinement, and prints the table."""
    rows = []
    for original in scenes:
        scene = original if options.hawp else without_hawp(original, options.out)
        for seed in (int(s) for s in numbers(options.seeds)):
            run = options.out / "runs" / scene.name / f"all-views-full-budget-seed-{seed}"
            reconstruct(options.neat, scene, run, seed, *run_arguments(options, None, None))
            row = {"object": scene.name, "seed": seed}
            for name, switches in WITHOUT.items():
                copy = options.out / "refinement" / scene.name / f"seed-{seed}" / name.replace(" ", "-")
                distill(options, scene, run, copy, switches)
                row[name] = {
                    "errors": junction_errors(scene, copy),
                    "f": f_scores(options, scene, copy),
                }
            rows.append(row)
            print(".", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    (options.out / "refinement.json").write_text(json.dumps(rows, indent=1))
    refinement_table(rows)


def distill(options, scene, run, copy, switches):
    """Distils a copy of a run with some switches of the fast back end off."""
    if copy.exists():
        shutil.rmtree(copy)
    shutil.copytree(run, copy)
    command = [options.neat, "distill", copy, "--scene", scene, "--backend", "flex", "--quiet"]
    for switch in switches:
        command += ["--set", f"distill.fast.{switch}=false"]
    call(*command)


def junction_errors(scene, run):
    """The distance of each true junction from the nearest found one, in world units."""
    truth = json.loads((scene / "gt_wireframe.json").read_text())["junctions"]
    found = json.loads((run / "wireframe.json").read_text())["junctions"]
    return [min((math.dist(x, y) for y in found), default=math.inf) for x in truth]


def f_scores(options, scene, run):
    command = [options.neat, "eval", "--pred", run / "wireframe.json"]
    command += ["--gt", scene / "gt_wireframe.json", "--format", "json"]
    command += ["--thresholds", ",".join(str(x) for x in REFINEMENT_THRESHOLDS)]
    command += ["--matching", "per-threshold"]
    graph = json.loads(call(*command))[0]["scores"]["wireframe"]
    return {
        key: [f_score(score["precision"], score["recall"]) for score in graph[key]]
        for key in ("junctions", "segments_max")
    }


def refinement_table(rows):
    """Median errors of the junctions that all runs of a field have, and F-scores."""
    print(
        "| object | seed | junctions | "
        + " | ".join(f"{name}, median error" for name in WITHOUT)
        + " | gain | "
        + " | ".join(f"F at {x:g}, refined / unrefined" for x in REFINEMENT_THRESHOLDS)
        + " |"
    )
    print("| --- | --: | --: |" + " --: |" * (len(WITHOUT) + 1) + " --- |" * len(REFINEMENT_THRESHOLDS))
    gains = []
    for row in rows:
        of_runs = [row[name]["errors"] for name in WITHOUT]
        common = [errors for errors in zip(*of_runs) if max(errors) <= MAX_JUNCTION_ERROR]
        medians = [statistics.median(errors) for errors in zip(*common)] or [math.nan] * len(WITHOUT)
        gains.append(medians[-1] / medians[0] if medians[0] > 0 else math.inf)
        cells = [f"{median:.5f}" for median in medians] + [f"**{gains[-1]:.1f}**"]
        for index in range(len(REFINEMENT_THRESHOLDS)):
            both = [
                f"J {row[name]['f']['junctions'][index]:.2f} S {row[name]['f']['segments_max'][index]:.2f}"
                for name in ("refined", "unrefined")
            ]
            cells.append(" / ".join(both))
        print(f"| {row['object']} | {row['seed']} | {len(common)} | " + " | ".join(cells) + " |")
    print(f"| **median, least** | | | | | | | **{statistics.median(gains):.1f}, {min(gains):.1f}** |" + " |" * len(REFINEMENT_THRESHOLDS))


def main():
    options = arguments()
    options.out.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("NEAT_CACHE", str((options.out / "cache").absolute()))
    if options.refinement:
        measure_refinement(options, scenes_with_truth(options))
        return
    means = table(measure(options))
    if options.plot:
        plot(means, options.plot)


if __name__ == "__main__":
    main()
