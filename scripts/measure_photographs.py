#!/usr/bin/env python3
"""Reconstructs rendered photographs with exact truth and measures the results.

    scripts/measure_photographs.py DATA OUT                  seeds 0, 1 and 2
    scripts/measure_photographs.py DATA OUT --set KEY=VALUE  with another setting
    scripts/measure_photographs.py DATA OUT --preset neat    with another preset

DATA holds one folder per scene, with images, a COLMAP model and truth/. *Structure* is what
`neat export --only structure` leaves. The baseline of
Hofer et al. and, where PyPI's pylimap is installed, LIMAP 2 get the 2D segments that neat
detected. OUT keeps every run, so that an interrupted measurement goes on. Prints a Markdown
table; OUT/measurements.json holds every number. Needs Python 3.9 and nothing else.
"""

import argparse
import importlib.util
import json
import pathlib
import sys
import time

from measuring import call, f_score, reconstruct, settings


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--neat", default="target/release/neat", help="the program")
    parser.add_argument("--scenes", help="names of folders, with commas; all with truth/")
    parser.add_argument("--seeds", default="0,1,2")
    parser.add_argument("--preset", default="fast", help="what the runs start from")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--no-rivals", action="store_true", help="neat alone")
    return parser.parse_args()


def evaluate(options, scene, wireframe):
    """One row: P, R and F1 of creases and P and R of junctions at three thresholds."""
    text = call(options.neat, "eval", "--pred", wireframe, "--truth", scene, "--format", "json")
    report = json.loads(text)
    scores = report["scores"] if isinstance(report, dict) else report[0]["scores"]
    rows = scores["thresholds"]
    return {
        "thresholds": [row["threshold"] for row in rows],
        "precision": [row["length_on_crease"] or 0.0 for row in rows],
        "recall": [row["completeness"] or 0.0 for row in rows],
        "f1": [f_score(row["length_on_crease"] or 0.0, row["completeness"] or 0.0) for row in rows],
        "junction_precision": [row["junction_precision"] or 0.0 for row in rows],
        "junction_recall": [row["junction_recall"] or 0.0 for row in rows],
        "accuracy": (scores["segment_accuracy"] or {}).get("mean"),
        "edges": scores["predicted"]["edges"],
    }


def rivals(options, scene, run):
    """(name, wireframe, seconds) of the others on the same 2D segments."""
    out = options.out / "rivals" / scene.name
    out.mkdir(parents=True, exist_ok=True)
    start = time.time()
    # It detects the same as the run did.
    call(options.neat, "baseline", "line3d", scene, "--out", out / "line3d")
    yield "Line3D++ (ours)", out / "line3d" / "wireframe.json", time.time() - start
    if importlib.util.find_spec("limap"):
        start = time.time()
        script = pathlib.Path(__file__).with_name("limap_lines.py")
        call(sys.executable, script, scene, run / "detections", out / "limap.json")
        yield "LIMAP 2", out / "limap.json", time.time() - start


def measure(options):
    scenes = sorted(path.parent for path in options.data.glob("*/truth"))
    if options.scenes:
        scenes = [scene for scene in scenes if scene.name in options.scenes.split(",")]
    if not scenes:
        sys.exit(f"{options.data}: no folder holds truth/")
    results = []
    for scene in scenes:
        runs = []
        for seed in options.seeds.split(","):
            run = options.out / "runs" / scene.name / f"seed-{seed}"
            arguments = ["--no-cache", "--preset", options.preset, *settings(options.set)]
            manifest = reconstruct(options.neat, scene, run, seed, *arguments)
            seconds = sum(manifest["seconds"].values())
            scores = evaluate(options, scene, run / "wireframe.json")
            results.append({"scene": scene.name, "of": "neat", "seed": seed, "seconds": seconds, **scores})
            structure = options.out / "structure" / scene.name / f"seed-{seed}.json"
            structure.parent.mkdir(parents=True, exist_ok=True)
            call(options.neat, "export", run, "--only", "structure", "--out", structure)
            scores = evaluate(options, scene, structure)
            results.append({"scene": scene.name, "of": "neat, structure", "seed": seed, "seconds": seconds, **scores})
            runs.append(run)
            print(".", end="", file=sys.stderr, flush=True)
        if not options.no_rivals:
            for name, wireframe, seconds in rivals(options, scene, runs[0]):
                scores = evaluate(options, scene, wireframe)
                results.append({"scene": scene.name, "of": name, "seconds": seconds, **scores})
                print(".", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    (options.out / "measurements.json").write_text(json.dumps(results, indent=1))
    return results


def table(results):
    print("| scene | of | seed | F1 | precision | recall | junctions P | junctions R | ACC-L | edges | seconds |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --: | --: | --: |")
    cell = lambda values: " / ".join(f"{value:.3f}" for value in values)
    for row in results:
        shares = [cell(row[key]) for key in
                  ("f1", "precision", "recall", "junction_precision", "junction_recall")]
        print(f"| {row['scene']} | {row['of']} | {row.get('seed', '')} | " + " | ".join(shares)
              + f" | {1000 * (row['accuracy'] or 0):.1f} | {row['edges']} | {row['seconds']:.1f} |")


if __name__ == "__main__":
    table(measure(arguments()))
