"""Which creases of a surface are seen, by rays."""

import numpy as np
import trimesh

from .cameras import within

SHARP = np.cos(np.radians(30.0))
# Bends of a chain of creases up to here are of one round edge.
ROUND = np.cos(np.radians(20.0))
STRAIGHT = np.cos(np.radians(0.05))
STEP, VIEWS, PIXELS = 0.025, 3, 8.0
# So far off the plane of what is beside it, in metres, is something behind or before it.
OFF = 0.005


def creases(vertices, triangles, endless):
    """Straight creases, as they end at each other, and round ones as polylines.

    Faces that are `endless` end somewhere, but not for anyone who looks: no crease is between them.
    """
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    mesh.merge_vertices(digits_vertex=6)
    normals = mesh.face_normals
    pairs = mesh.face_adjacency
    sharp = (normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(1) < SHARP
    sharp &= ~endless[pairs].all(1)
    points = np.asarray(mesh.vertices)
    edges = mesh.face_adjacency_edges[sharp]
    edges = edges[np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1) > 1e-6]
    chains = chained(points, edges)
    straight, curved = [], []
    for chain in chains:
        line = points[chain]
        steps = np.diff(line, axis=0)
        steps /= np.linalg.norm(steps, axis=1, keepdims=True)
        bends = (steps[1:] * steps[:-1]).sum(1)
        if len(bends) and bends.min() < STRAIGHT:
            curved.append(line)
        else:
            straight.append(line[[0, -1]])
    return straight, curved


def chained(points, edges):
    """Edges that go on in each other, where nothing else ends, with small bends."""
    at = {}
    for edge, (a, b) in enumerate(edges):
        at.setdefault(a, []).append(edge)
        at.setdefault(b, []).append(edge)

    def following(edge, end):
        others = [other for other in at[end] if other != edge]
        if len(others) != 1:
            return None
        far = edges[others[0]][edges[others[0]] != end][0]
        near = edges[edge][edges[edge] != end][0]
        before, after = points[end] - points[near], points[far] - points[end]
        cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
        return (others[0], far) if cosine > ROUND else None

    chains, used = [], set()
    for first in range(len(edges)):
        if first in used:
            continue
        used.add(first)
        chain = list(edges[first])
        for side in (1, 0):
            edge = first
            while (step := following(edge, chain[-1] if side else chain[0])) and step[
                0
            ] not in used:
                edge, end = step
                used.add(edge)
                chain.insert(len(chain) if side else 0, end)
        chains.append(chain)
    return chains


class Sight:
    """Rays through a surface with leaves."""

    def __init__(self, vertices, triangles, scale):
        self.mesh = trimesh.Trimesh(vertices, triangles, process=False)
        self.normals, self.scale = self.mesh.face_normals, scale
        self.caster = trimesh.ray.ray_pyembree.RayMeshIntersector(self.mesh)

    def first(self, center, directions):
        """Distance along each unit direction to what is hit first, and its normal."""
        hits = self.caster.intersects_first(np.tile(center, (len(directions), 1)), directions)
        normals = self.normals[hits]
        on = self.mesh.vertices[self.mesh.faces[hits, 0]]
        slant = (normals * directions).sum(1)
        away = ((on - center) * normals).sum(1) / np.where(np.abs(slant) < 1e-12, 1e-12, slant)
        return np.where(hits < 0, np.inf, away), np.where(hits[:, None] < 0, 0.0, normals)

    def seen(self, camera, points, directions):
        """Whether edges with a direction are visible at points, and the points in the picture."""
        center = camera.center
        at, depth = camera.projected(points)
        inside = (depth > 0.01 * self.scale) & within(at, 2)
        result, chosen = np.zeros(len(points), bool), np.flatnonzero(inside)
        away = np.linalg.norm(points[chosen] - center, axis=1)
        free, _ = self.first(center, (points[chosen] - center) / away[:, None])
        near = np.maximum(0.25 * away / camera.focal, 1e-4 * self.scale)
        chosen = chosen[free > away - near]
        moved, _ = camera.projected(points[chosen] + 1e-3 * self.scale * directions[chosen])
        across = moved - at[chosen]
        length = np.linalg.norm(across, axis=1, keepdims=True)
        across = np.column_stack([-across[:, 1], across[:, 0]]) / np.maximum(length, 1e-12)
        rays = [camera.rays(at[chosen] + side * across) for side in (-1, 1)]
        (near, one), (far, two) = (self.first(center, of_side) for of_side in rays)
        # Seen surfaces differ if they turn, or if what is on one side lies off the plane of the other.
        bent = (one * two).sum(1) < SHARP
        with np.errstate(invalid="ignore"):
            apart = far[:, None] * rays[1] - near[:, None] * rays[0]
            off = np.maximum(np.abs((apart * one).sum(1)), np.abs((apart * two).sum(1)))
            step = ~(off < OFF * self.scale)
        result[chosen[bent | step]] = True
        return result, at


def visible(sight, cameras, lines, scale):
    """Pieces of polylines that enough views see, and whether each end is one of its line."""
    places = [sampled(line, STEP * scale) for line in lines]
    starts = np.concatenate([[0], np.cumsum([len(share) for share, _, _ in places])])
    of = np.repeat(np.arange(len(lines)), np.diff(starts))
    points = np.concatenate([points for _, points, _ in places])
    directions = np.concatenate([directions for _, _, directions in places])
    votes = np.zeros(len(points), int)
    for camera in cameras:
        seen, at = sight.seen(camera, points, directions)
        for line in np.unique(of[seen]):
            here = slice(starts[line], starts[line + 1])
            for low, high in runs(seen[here]):
                steps = np.linalg.norm(np.diff(at[here][low:high], axis=0), axis=1)
                if steps.sum() * (high - low) / max(high - low - 1, 1) >= PIXELS:
                    votes[here][low:high] += 1
    pieces = []
    for index, line in enumerate(lines):
        count = starts[index + 1] - starts[index]
        for low, high in runs(votes[starts[index] : starts[index + 1]] >= VIEWS):
            piece = part(line, low / count, high / count)
            pieces.append((piece, (low == 0, high == count)))
    return pieces


def lengths_to(line):
    """Of a polyline from its start to each of its points."""
    return np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def at_share(line, share):
    """Points at shares of the length of a polyline."""
    to = lengths_to(line)
    return np.stack([np.interp(share * to[-1], to, line[:, axis]) for axis in range(3)], 1)


def sampled(line, step):
    """Shares of the length, points and directions along a polyline, two at least."""
    to = lengths_to(line)
    count = max(int(np.ceil(to[-1] / step)), 2)
    share = (np.arange(count) + 0.5) / count
    of = np.searchsorted(to, share * to[-1], side="right") - 1
    directions = np.diff(line, axis=0)[of.clip(0, len(line) - 2)]
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return share, at_share(line, share), directions


def part(line, low, high):
    """A polyline from one share of its length to another."""
    to = lengths_to(line)
    between = (to > low * to[-1]) & (to < high * to[-1])
    between[[0, -1]] = False
    start, end = at_share(line, np.array([low, high]))
    return np.concatenate([[start], line[between], [end]])


def runs(mask):
    """Where a mask is true: first and one past last of each run."""
    change = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return change.reshape(-1, 2)
