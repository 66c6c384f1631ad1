#!/usr/bin/env python3
"""Writes scenes of everyday CAD parts with exact truth.

    scripts/make_parts.py OUT [--set first|second|round|third|fourth|catalogue] [NAME...]
    scripts/make_parts.py OUT --random SEED...

Each scene is a folder of OUT: 60 grey pictures on black, cameras.json,
gt_wireframe.json and mesh.obj, for `neat reconstruct` and
`cargo run --release -p neat-eval --example measure_assembler -- OUT/*`.
Needs what scripts/requirements-parts.txt names; a part takes about 20 seconds.
The set "catalogue" needs two packages more (cad_parts/catalogue.py).
"""

import argparse
import json
import pathlib
import sys

import numpy as np
from PIL import Image

from cad_parts import pictures, random_parts, shapes, truth

VIEWS = 60


def main():
    sets = {
        "first": shapes.FIRST,
        "second": shapes.SECOND,
        "round": shapes.ROUND,
        "third": shapes.THIRD,
        "fourth": shapes.FOURTH,
    }
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=pathlib.Path, help="folder for the scenes")
    parser.add_argument("names", nargs="*", help="parts, all unless some are named")
    parser.add_argument(
        "--set", choices=[*sets, "catalogue"], help="one of the sets of parts alone"
    )
    parser.add_argument(
        "--random", type=int, nargs="+", metavar="SEED", help="parts that nobody drew, by seeds"
    )
    parser.add_argument("--truth", action="store_true", help="write the truth alone")
    options = parser.parse_args()
    if options.random:
        if options.set or options.names:
            parser.error("--random makes parts of seeds, not of a set or with a name")
        for seed in options.random:
            folder = options.out / f"random_{seed:03d}"
            write(random_parts.part(seed), folder, seed, options.truth)
            print(folder, flush=True)
        return
    if options.set == "catalogue":
        from cad_parts import catalogue  # Of packages that nothing else needs.

        sets["catalogue"] = catalogue.CATALOGUE
    of_set = sets[options.set] if options.set else sum(sets.values(), [])
    parts = {part.__name__: part for part in of_set}
    unknown = [name for name in options.names if name not in parts]
    if unknown:
        sys.exit(f"no part {', '.join(unknown)}; there are {', '.join(parts)}")
    for seed, name in enumerate(parts):
        if not options.names or name in options.names:
            write(parts[name](), options.out / name, seed, options.truth)
            print(options.out / name, flush=True)


def write(part, folder, seed, truth_alone):
    shape = part.part.solids()[0].wrapped
    mesh = truth.mesh(shape, 1e-4 * max(part.part.bounding_box().size))
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    place = lambda points: (points - (low + high) / 2) / (high - low).max()
    mesh.vertices = place(mesh.vertices)
    (folder / "images").mkdir(parents=True, exist_ok=True)
    wireframe = truth.wireframe(shape, place) | {"faces": truth.faces(shape, place)}
    (folder / "gt_wireframe.json").write_text(json.dumps(wireframe))
    rows = ["v {} {} {}".format(*point) for point in mesh.vertices.round(7)]
    rows += ["f {} {} {}".format(*triangle) for triangle in mesh.triangles + 1]
    (folder / "mesh.obj").write_text("\n".join(rows) + "\n")
    if truth_alone:
        return
    middle = pictures.SIZE / 2
    intrinsics = [[pictures.FOCAL, 0, middle], [0, pictures.FOCAL, middle], [0, 0, 1]]
    frames = []
    for view, (values, pose) in enumerate(pictures.pictures(mesh, VIEWS, seed)):
        file = f"images/image_{view:04d}.png"
        Image.fromarray(values).save(folder / file)
        size = {"width": pictures.SIZE, "height": pictures.SIZE}
        frames.append({"file": file, **size, "K": intrinsics, "c2w": np.round(pose, 12).tolist()})
    convention = "corner-origin K (pixel centre at +0.5)"
    text = json.dumps({"convention": convention, "frames": frames})
    (folder / "cameras.json").write_text(text)


if __name__ == "__main__":
    main()
