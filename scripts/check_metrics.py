#!/usr/bin/env python3
"""The evaluation protocols once more, with NumPy, SciPy and trimesh.

An implementation that shares nothing with neat-eval. The scores of a small
synthetic result lie beside it in neat-eval/tests/data, where the test
`independent` compares them with those of Rust.

    check_metrics.py            computes them again and compares
    check_metrics.py --write    makes the result anew, with its scores
"""

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np
import trimesh
from scipy.io import loadmat, savemat
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

DATA = Path(__file__).resolve().parent.parent / "neat-eval/tests/data"
MILLIMETRES = 100.0  # the unit cube is 10 cm on DTU's table
METRES = 10.0  # and 10 m as a building


# --- the synthetic result ---------------------------------------------------


def write_inputs():
    """A box with a missing, an additional and a broken edge, and an arc."""
    rng = np.random.default_rng(6)
    corners = np.array([[x, y, z] for x in (0.2, 0.8) for y in (0.1, 0.7) for z in (0.3, 0.9)])
    edges = [(a, b) for a in range(8) for b in range(a) if np.count_nonzero(corners[a] != corners[b]) == 1]
    angles = np.linspace(0, math.pi / 2, 24)
    arc = np.stack([0.5 + 0.25 * np.cos(angles), 0.4 + 0.25 * np.sin(angles), np.full(24, 0.3)], axis=1)
    write_json("truth.json", {
        "junctions": corners.tolist(),
        "lines": edges,
        "curves": [{"type": "Circle", "points": arc.tolist()}],
    })

    noise = rng.normal(scale=[[0.002]] * 4 + [[0.008]] * 3 + [[0.03]], size=(8, 3))
    junctions = np.concatenate([corners + noise, [[0.5, 0.5, 0.95], [0.05, 0.9, 0.1]]])
    found = edges[:-2] + [(8, 3), (8, 6)]
    write_json("predicted.json", {"junctions": junctions.tolist(), "edges": found})

    # The arc as a cubic Bezier curve, a little beside the true one, and a curve
    # that is too short for a sample.
    k = 4 / 3 * math.tan(math.pi / 8)
    arc = np.array([[1, 0, 0], [1, k, 0], [k, 1, 0], [0, 1, 0]]) * 0.256 + [0.5, 0.4, 0.306]
    short = np.array([[0.3, 0.3, 0.3], [0.301, 0.3, 0.3], [0.302, 0.3, 0.3], [0.303, 0.3, 0.3]])
    lines = [[junctions[a].tolist(), junctions[b].tolist()] for a, b in found]
    write_json("parametric_edges.json", {
        "curves_ctl_pts": [arc.tolist(), short.tolist()],
        "lines_end_pts": lines,
    })

    # A scan of all faces, in millimetres, with a table below; the last third
    # along y was not seen.
    points = rng.uniform(0.0, 1.0, size=(1500, 3))
    face = rng.integers(0, 6, size=1500)
    points[np.arange(1500), face % 3] = face // 3
    points = (corners[0] + points * (corners[7] - corners[0])) * MILLIMETRES
    table = np.concatenate([rng.uniform(0, 100, size=(100, 2)), np.full((100, 1), 15.0)], axis=1)
    header = "ply\nformat ascii 1.0\nelement vertex 1600\nproperty double x\nproperty double y\nproperty double z\nend_header\n"
    rows = "\n".join(" ".join(f"{x:.3f}" for x in row) for row in np.concatenate([points, table]))
    (DATA / "scan.ply").write_text(header + rows + "\n")
    mask = np.ones((10, 9, 10), dtype=np.uint8)
    mask[:, 6:, :] = 0
    box = np.array([[2.5, 3.25, 4.0], [92.5, 83.25, 94.0]], dtype=np.float32)
    savemat(DATA / "ObsMask1_10.mat", {"ObsMask": mask, "BB": box, "Res": 10.0}, do_compression=True)
    savemat(DATA / "Plane1.mat", {"P": np.array([[0.0], [0.02], [1.0], [-20.0]])})


def write_json(name, content):
    (DATA / name).write_text(json.dumps(content, indent=1) + "\n")


# --- the protocols ----------------------------------------------------------


def near(a, b):
    return cKDTree(b).query(a)[0]


def neat_abc(predicted, truth):
    def shares(distances):
        rows, columns = linear_sum_assignment(distances)
        matched = distances[rows, columns]
        return [
            {"precision": float((matched < t).sum() / len(distances)), "recall": float((matched < t).sum() / len(distances[0]))}
            for t in (0.01, 0.02, 0.05)
        ]

    ends = [wireframe.junctions[wireframe.edges] for wireframe in (predicted, truth)]
    pairs = [np.stack([cdist(ends[0][:, i], ends[1][:, i ^ swap]) for i in (0, 1)]) for swap in (0, 1)]
    return {
        "junctions": shares(cdist(predicted.junctions, truth.junctions)),
        "segments_max": shares(np.minimum(pairs[0].max(axis=0), pairs[1].max(axis=0))),
        "segments_mean": shares(np.minimum(pairs[0].mean(axis=0), pairs[1].mean(axis=0))),
    }


def neat_surface(predicted, scan, mask=None, plane=None, thinning=None):
    start, end = np.moveaxis(predicted.junctions[predicted.edges], 1, 0)
    t = np.linspace(0, 1, 32)[:, None, None]
    samples = (start * (1 - t) + end * t).reshape(-1, 3)
    if thinning:
        kept = []
        for order in (range(len(samples)), reversed(range(len(samples)))):
            chosen = []
            for i in order:
                if not chosen or np.linalg.norm(samples[chosen] - samples[i], axis=1).min() > thinning:
                    chosen.append(i)
            kept.append(samples[chosen])
        # Only shared ends are that near, so that the random order is no matter.
        assert np.allclose(*(np.unique(k.round(9), axis=0) for k in kept))
        samples = kept[0]
    junctions = predicted.junctions[np.unique(predicted.edges)]
    seen, junctions_seen = samples, junctions
    if mask is not None:
        box = mask["BB"].astype(np.float32)
        inside = ((samples >= box[0] - 60) & (samples < box[1] + 120)).all(axis=1)
        samples = samples[inside]
        seen, junctions_seen = (observed(p, mask) for p in (samples, junctions))
    above = scan if plane is None else scan[scan @ plane[:3] + plane[3] > 0]

    def mean(distances):
        return float(distances[distances < 20].mean())

    return {
        "junction_accuracy": mean(near(junctions_seen, scan)),
        "segment_accuracy": mean(near(seen, scan)),
        "completeness": mean(near(above, samples)),
        "observed_samples": len(seen),
    }


def observed(points, mask):
    cells = mask["ObsMask"]
    index = np.rint((points - mask["BB"][0]) / mask["Res"]).astype(int)
    valid = ((index >= 0) & (index < cells.shape)).all(axis=1)
    return points[valid][cells[tuple(index[valid].T)] > 0]


def bezier(control, t):
    s = 1 - t[:, None]
    t = t[:, None]
    return s**3 * control[0] + 3 * s**2 * t * control[1] + 3 * s * t**2 * control[2] + t**3 * control[3]


def arc_length(control):
    points = bezier(control, np.linspace(0, 1, 200001))
    return np.linalg.norm(np.diff(points, axis=0), axis=1).sum()


def voxel_means(points, cell, origin):
    index = np.floor((points - origin) / cell).astype(int)
    _, group = np.unique(index, axis=0, return_inverse=True)
    group = group.ravel()
    sums = np.stack([np.bincount(group, weights=points[:, axis]) for axis in range(3)], axis=1)
    return sums / np.bincount(group)[:, None]


def edge_points(model, truth, protocol):
    spacing = 0.005
    count = (lambda _: 500) if protocol == "nef" else (lambda length: int(length // spacing))
    points = [bezier(c, np.linspace(0, 1, count(arc_length(c)))) for c in model["curves"]]
    for start, end in model["lines"]:
        t = np.linspace(0, 1, count(np.linalg.norm(end - start)))[:, None]
        points.append(start * (1 - t) + end * t)
    points = np.concatenate(points)
    if protocol == "emap":
        points = voxel_means(points, 2 / 256, -1.0)
    elif protocol == "curve-gaussian":
        points = voxel_means(points, 1 / 256, 0.0)
    elif protocol == "nef":
        points = voxel_means(points, 1 / 64, points.min(axis=0) - 1 / 128)

    polylines = [truth.junctions[list(edge)] for edge in truth.edges] + truth.curves
    if protocol == "nef":
        truths = np.concatenate(polylines)
    else:
        pieces = [(p[i], p[i + 1]) for p in polylines for i in range(len(p) - 1)]
        truths = []
        for start, end in pieces:
            t = np.linspace(0, 1, int(np.linalg.norm(end - start) // spacing))[:, None]
            truths.append(start * t + end * (1 - t))
        truths = np.concatenate(truths)

    accuracy, completeness = near(points, truths), near(truths, points)
    shares = []
    for threshold in (0.02,) if protocol == "nef" else (0.005, 0.01, 0.02):
        correct, found = int((accuracy < threshold).sum()), int((completeness < threshold).sum())
        precision, recall = correct / len(accuracy), found / len(completeness)
        shares.append({
            "precision": precision,
            "recall": recall,
            "f_score": 2 * precision * recall / (precision + recall),
            "iou": min(correct, found) / (len(accuracy) + len(completeness) - max(correct, found)),
        })
    return {
        "predicted_points": len(points),
        "true_points": len(truths),
        "accuracy": float(accuracy.mean()),
        "completeness": float(completeness.mean()),
        "thresholds": shares,
    }


def limap(predicted, scan):
    scores = []
    segments = predicted.junctions[predicted.edges]
    t = ((np.arange(1000) + 0.5) / 1000)[:, None]
    distances = [near(start * (1 - t) + end * t, scan) for start, end in segments]
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    for threshold in (0.001, 0.005, 0.01, 0.05, 0.1, 0.5, 1.0):
        ratios = np.array([(d <= threshold).mean() for d in distances])
        scores.append({
            "length_recall": float(lengths @ ratios),
            "precision_percent": 100 * float((ratios > 0).mean()),
        })
    return scores


def hss(predicted, truth):
    distances = cdist(predicted.junctions, truth.junctions)
    matched = int((distances[linear_sum_assignment(distances)] <= 0.5).sum())
    precision, recall = matched / len(distances), matched / len(distances[0])
    f1 = 2 * precision * recall / (precision + recall)
    solids = [union([prism(*w.junctions[list(edge)]) for edge in w.edges]) for w in (predicted, truth)]
    common = trimesh.boolean.intersection(solids, engine="manifold").volume
    iou = common / (solids[0].volume + solids[1].volume - common)
    return {"hss": 2 * f1 * iou / (f1 + iou), "vertex_f1": f1, "edge_iou": iou}


def prism(start, end, radius=0.5):
    """The published solid: the cross axis that is more nearly perpendicular stays."""
    direction = (end - start) / np.linalg.norm(end - start)
    frame = np.eye(4)
    frame[:3, 2], frame[:3, 3] = direction, (start + end) / 2
    if abs(direction[0]) < abs(direction[1]):
        frame[:3, 1] = np.cross(direction, [1, 0, 0])
    else:
        frame[:3, 0] = np.cross([0, 1, 0], direction)
    return trimesh.creation.cylinder(radius, np.linalg.norm(end - start), sections=6, transform=frame)


def union(meshes):
    return trimesh.boolean.union(meshes, engine="manifold")


def wed(predicted, truth, register):
    vertices = predicted.junctions
    if register:
        spread = lambda p: np.linalg.norm(np.where(p.std(axis=0) == 0, 1, p.std(axis=0)))
        vertices = (vertices - vertices.mean(axis=0)) / spread(vertices) * spread(truth.junctions) + truth.junctions.mean(axis=0)
    distances = cdist(vertices, truth.junctions)
    rows, columns = linear_sum_assignment(distances)
    to_truth = dict(zip(rows, columns))
    edge_set = lambda edges: {frozenset(map(int, e)) for e in edges}
    found = edge_set((to_truth[a], to_truth[b]) for a, b in predicted.edges if a in to_truth and b in to_truth)
    true = edge_set(truth.edges)
    from_truth = {column: row for row, column in to_truth.items()}
    length = lambda edge, points, index: np.linalg.norm(np.subtract(*(points[index(v)] for v in edge)))
    diameter = cdist(truth.junctions, truth.junctions).max()
    cost = distances[rows, columns].sum()
    cost += diameter * (0.25 * (len(vertices) - len(rows)) + 0.5 * (len(truth.junctions) - len(rows)))
    cost += sum(length(edge, vertices, from_truth.get) for edge in found - true)
    cost += sum(length(edge, truth.junctions, lambda v: v) for edge in true - found)
    return float(cost / sum(length(edge, truth.junctions, lambda v: v) for edge in true))


# --- the whole --------------------------------------------------------------


class Wireframe:
    def __init__(self, content, scale=1.0):
        self.junctions = np.array(content["junctions"]) * scale
        self.edges = np.array(content.get("edges") or content["lines"])
        self.curves = [np.array(curve["points"]) * scale for curve in content.get("curves", [])]


def compute():
    load = lambda name: json.loads((DATA / name).read_text())
    result, truth = load("predicted.json"), load("truth.json")
    edges = load("parametric_edges.json")
    model = {"curves": np.array(edges["curves_ctl_pts"]), "lines": np.array(edges["lines_end_pts"])}
    text = (DATA / "scan.ply").read_text().split("end_header\n")[1]
    scan = np.array([row.split() for row in text.splitlines()], dtype=float)
    mask = loadmat(DATA / "ObsMask1_10.mat")
    plane = loadmat(DATA / "Plane1.mat")["P"].ravel()
    on_table, building = Wireframe(result, MILLIMETRES), Wireframe(result, METRES)
    true_building = Wireframe(truth, METRES)
    points = {
        protocol: edge_points(model, Wireframe(truth), protocol)
        for protocol in ("emap", "curve-gaussian", "edge-gaussians", "nef")
    }
    return {
        "neat-abc": neat_abc(Wireframe(result), Wireframe(truth)),
        "neat-dtu": neat_surface(on_table, scan, mask, plane, thinning=0.2),
        "neat-blended-mvs": neat_surface(on_table, scan),
        **points,
        "limap-tnt": limap(Wireframe(result, 1.0), scan / MILLIMETRES),
        "hss": hss(building, true_building),
        "wed": {"registered": wed(building, true_building, True), "plain": wed(building, true_building, False)},
    }


def differences(found, expected, path=""):
    if isinstance(expected, dict):
        for key in expected.keys() | found.keys():
            yield from differences(found.get(key), expected.get(key), f"{path}/{key}")
    elif isinstance(expected, list):
        for i, pair in enumerate(zip(found, expected, strict=True)):
            yield from differences(*pair, f"{path}/{i}")
    elif found is None or expected is None or abs(found - expected) > 1e-9 * max(1.0, abs(expected)):
        yield f"{path}: {found} is not {expected}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="make the stored result and its scores anew")
    if parser.parse_args().write:
        write_inputs()
        write_json("scores.json", compute())
        return 0
    wrong = list(differences(compute(), json.loads((DATA / "scores.json").read_text())))
    print("\n".join(wrong) or "all scores are those that are stored")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
