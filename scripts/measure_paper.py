#!/usr/bin/env python3
"""The experiments of the NEAT paper on the scenes at hand, beside its numbers.

    scripts/measure_paper.py DATA OUT                       tables 2, 3, 4 and 6
    scripts/measure_paper.py DATA OUT --tables 2,3,4 --scenes house_1
    scripts/measure_paper.py DATA OUT --set train.steps=1000

DATA holds scenes with exact truth: objects with gt_wireframe.json, photographs (in DATA or
DATA/photoreal) with truth/; and scans with sparse_points.ply, which say how far a result is from
points of the surface. Tables 2, 3 and 4 come from `neat ablate` with the paper's back end on the
scenes of --scenes, table 6 from all objects that have straight edges. OUT keeps every run, so
that an interrupted measurement goes on. Prints Markdown; OUT/paper.json holds every number. Needs
Python 3.9 and nothing else.
"""

import argparse
import csv
import json
import os
import pathlib
import sys

from measure_objects import scenes_with_truth
from measuring import call, reconstruct, settings

PAPER_BACK_END = ["--set", "distill.back_end=paper"]

# What the paper says of DTU 24 (tables 2 and 4, 3), and of four objects (table 6).
PAPER = {
    2: ["View Dir. no, clustering no: ACC-J .755, ACC-L .537, 446 lines, 520 junctions",
        "yes, no: .563, .472, 523, 460", "yes, yes: .456, .420, 578, 528"],
    3: ["1 px: ACC-J .665, ACC-L .537, 589 lines, 402 junctions, MR 97.5 %, 17.79 dB",
        "5 px: .537, .456, 578, 528, 89.7 %, 21.55 dB",
        "20 px: .400, .366, 430, 366, 66.1 %, 24.68 dB"],
    4: ["refined: ACC-J .456, ACC-L .420, 578 lines, 528 junctions",
        "not refined: .728, .554, 606, 448"],
    6: ["mean of four: junctions P .74 / .82 / .86, R .83 / .93 / .99; segments P .78 / .85 / .87, "
        "R .76 / .85 / .87; ideal baseline .958 of the junctions, .894 of the segments"],
}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--neat", default="target/release/neat", help="the program")
    parser.add_argument("--tables", default="2,3,4,6", help="numbers, with commas")
    parser.add_argument("--scenes", default="abc-00075213,house_1,dtu-scan24",
                        help="scenes of tables 2, 3 and 4, with commas")
    parser.add_argument("--objects", help="objects of table 6, with commas; all with a truth")
    parser.add_argument("--preset", default="neat", help="what the runs start from")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    return parser.parse_args()


def find(data, name):
    """The folder of a scene, and how `neat ablate` is told its truth."""
    for scene in (data / name, data / "photoreal" / name):
        if (scene / "truth").is_dir():
            return scene, ["--truth", scene, "--threshold", "0.05"]
        if (scene / "gt_wireframe.json").is_file():
            return scene, ["--gt", scene / "gt_wireframe.json"]
        if (scene / "sparse_points.ply").is_file():
            return scene, ["--points", scene / "sparse_points.ply"]
    sys.exit(f"{data / name}: no scene with truth/, gt_wireframe.json or sparse_points.ply")


def ablations(options):
    """The rows of `neat ablate`, scene by scene."""
    results = {}
    for name in options.scenes.split(","):
        scene, truth = find(options.data, name)
        out = options.out / "ablations" / name
        call(options.neat, "ablate", scene, "--out", out, *truth, "--preset", options.preset,
             *PAPER_BACK_END, *settings(options.set), "--seed", options.seed,
             "--backend", "flex", "--quiet")
        with open(out / "ablation.csv", newline="") as file:
            results[name] = list(csv.DictReader(file))
        print(".", end="", file=sys.stderr, flush=True)
    return results


def objects(options):
    """Precision, recall and the ideal baseline of every object (table 6)."""
    results = {}
    for scene in scenes_with_truth(options):
        run = options.out / "objects" / scene.name
        reconstruct(options.neat, scene, run, options.seed, "--no-doctor", "--preset",
                    options.preset, *PAPER_BACK_END, *settings(options.set))
        text = call(options.neat, "eval", "--pred", run / "wireframe.json", "--gt",
                    scene / "gt_wireframe.json", "--scene", scene, "--format", "json")
        results[scene.name] = json.loads(text)[0]["scores"]
        print(".", end="", file=sys.stderr, flush=True)
    return results


def print_ablation(number, rows_by_scene):
    columns = ["junctions", "segments", "J precision", "J recall", "S precision", "S recall",
               "ACC-J", "ACC-L", "PSNR dB", "mask ratio"]
    print(f"\nTable {number}. Paper, DTU 24: " + "; ".join(PAPER[number]) + ".\n")
    print("| scene | variant | " + " | ".join(columns) + " |")
    print("| --- | --- |" + " --: |" * len(columns))
    for scene, rows in rows_by_scene.items():
        for row in rows:
            if row["table"].endswith(f"table {number}"):
                cells = [row[column] or "-" for column in columns]
                print(f"| {scene} | {row['variant']} | " + " | ".join(cells) + " |")


def print_objects(results):
    print("\nTable 6. Paper, " + "; ".join(PAPER[6]) + ".\n")
    print("| object | junctions P | junctions R | segments P | segments R | ideal junctions | ideal segments |")
    print("| --- | --- | --- | --- | --- | --: | --: |")
    rows = []
    for name, scores in results.items():
        graph, ideal, truth = scores["wireframe"], scores["ideal_baseline"], scores["truth"]
        shares = [[entry[key] for entry in graph[of]]
                  for of in ("junctions", "segments_max") for key in ("precision", "recall")]
        shares += [[ideal[of] / truth[of]] for of in ("junctions", "segments")]
        rows.append((name, shares))
    mean = [[sum(values) / len(values) for values in zip(*column)]
            for column in zip(*(shares for _, shares in rows))]
    for name, shares in [*rows, ("**mean**", mean)]:
        cells = [" / ".join(f"{value:.3f}" for value in column) for column in shares]
        print(f"| {name} | " + " | ".join(cells) + " |")


def main():
    options = arguments()
    options.out.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("NEAT_CACHE", str((options.out / "cache").absolute()))
    tables = [int(number) for number in options.tables.split(",")]
    of_scenes = ablations(options) if {2, 3, 4} & set(tables) else {}
    of_objects = objects(options) if 6 in tables else {}
    print(file=sys.stderr)
    numbers = {"ablations": of_scenes, "objects": of_objects}
    (options.out / "paper.json").write_text(json.dumps(numbers, indent=1))
    for number in tables:
        if number == 6:
            print_objects(of_objects)
        else:
            print_ablation(number, of_scenes)


if __name__ == "__main__":
    main()
