#!/usr/bin/env python3
"""Writes scenes of path-traced photographs with exact truth.

    scripts/make_photographs.py OUT KIND SEED...

KIND is house, facade, room or table; each seed is another one. A scene is a folder
of OUT with images, a COLMAP model with noise in sparse/0 and truth/, for
`scripts/measure_photographs.py OUT RUNS` and `neat eval --truth OUT/house_7`.
Needs what scripts/requirements-photographs.txt names; a picture takes 5 to 30
seconds on two threads.
"""

import argparse
import json
import pathlib
import time

import numpy as np
import trimesh
from photographs import colmap, facades, houses, render, rooms, tables, truth
from photographs.cameras import HEIGHT, MIDDLE, WIDTH, Camera

ENDLESS = ["grass", "asphalt", "floor"]
SIZE = {"width": WIDTH, "height": HEIGHT}
KINDS = {"house": houses, "facade": facades, "room": rooms, "table": tables}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=pathlib.Path, help="folder for the scenes")
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("seeds", nargs="+", type=int)
    parser.add_argument("--truth", action="store_true", help="write truth/ alone")
    parser.add_argument("--views", type=int, help="only the first so many")
    options = parser.parse_args()
    for seed in options.seeds:
        folder = options.out / f"{options.kind}_{seed}"
        write(KINDS[options.kind], seed, folder, options.views, options.truth)
        print(folder, flush=True)


def write(kind, seed, folder, count, truth_alone):
    random = np.random.default_rng(seed)
    part, leaves, views = kind.build(random)
    vertices, triangles, materials = part.surface()
    cameras = [Camera.looking(eye, at, kind.FOCAL) for eye, at in views[:count]]
    everything = joined([(vertices, triangles), *leaves])
    sight = truth.Sight(*everything, kind.SCALE)
    names = [f"{view + 1:04d}.jpg" for view in range(len(cameras))]
    endless = np.isin(materials, ENDLESS)
    solid = (vertices, triangles, endless)
    write_truth(folder / "truth", kind, seed, solid, everything, cameras, names, sight)
    if truth_alone:
        return
    (folder / "images").mkdir(parents=True, exist_ok=True)
    render.prepare((vertices, triangles, materials), leaves, kind.SCALE, kind.FOCAL, random)
    pictures = []
    for name, camera in zip(names, cameras):
        started = time.monotonic()
        picture = render.picture(camera, random)
        picture.save(folder / "images" / name, quality=92, subsampling=0)
        pictures.append(np.asarray(picture))
        print(f"{folder}/images/{name} {time.monotonic() - started:.0f} s", flush=True)
    colmap.write(folder / "sparse" / "0", cameras, pictures, names, sight, kind.SCALE, random)


def joined(meshes):
    vertices, triangles, first = [], [], 0
    for points, faces in meshes:
        vertices.append(points)
        triangles.append(faces + first)
        first += len(points)
    return np.concatenate(vertices), np.concatenate(triangles)


def write_truth(folder, kind, seed, solid, everything, cameras, names, sight):
    folder.mkdir(parents=True, exist_ok=True)
    straight, curved = truth.creases(*solid)
    pieces = truth.visible(sight, cameras, straight, kind.SCALE)
    junctions, cut, edges, known = [], [], [], {}
    for ends, whole in pieces:
        edge = []
        for end, is_end in zip(ends, whole):
            key = tuple(np.round(end / (1e-4 * kind.SCALE)).astype(int)) if is_end else None
            if key is None or key not in known:
                known[key] = len(junctions)
                junctions.append(np.round(end, 6).tolist())
                cut.append(not is_end)
            edge.append(known[key])
        edges.append(edge)
    save = lambda name, value: (folder / name).write_text(json.dumps(value))
    save("wireframe.json", {"junctions": junctions, "edges": edges, "cut_end": cut})
    bent = truth.visible(sight, cameras, curved, kind.SCALE) if curved else []
    bent = [line.round(6) for line, _ in bent]
    save("curved.json", [line.tolist() for line in bent])
    save("texture_lines.json", [])
    frames = []
    for name, camera in zip(names, cameras):
        frame = {"name": name, **SIZE, "f": camera.focal}
        frame |= {"cx": MIDDLE[0], "cy": MIDDLE[1], "R": camera.rotation.tolist()}
        shift = -camera.rotation @ camera.center
        frames.append(frame | {"t": shift.tolist(), "centre": camera.center.tolist()})
    save("cameras.json", frames)
    mesh = trimesh.Trimesh(*everything, process=False)
    # A union leaves slivers, to which no distance can be told.
    mesh.update_faces(mesh.area_faces > 1e-12 * kind.SCALE**2)
    mesh.export(folder / "mesh.ply")
    length = lambda lines: float(
        sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines)
    )
    stats = {"scene": kind.__name__.split(".")[-1], "seed": seed, "unit": "m", "scale": kind.SCALE}
    stats |= {"views": len(cameras), **SIZE, "f": kind.FOCAL, "triangles": len(everything[1])}
    stats |= {"junctions": len(junctions), "junctions_corner": cut.count(False)}
    stats |= {"edges": len(edges), "edge_length": length([ends for ends, _ in pieces])}
    save("stats.json", stats | {"curved": len(bent), "curved_length": length(bent)})


if __name__ == "__main__":
    main()
