"""Pictures of a mesh as those of CAD parts: grey, on black, from all around."""

import math

import numba
import numpy as np

FOCAL, SIZE, SAMPLES = 875.0, 800, 3
# A part fills this share of a picture, from one of these distances.
FILLS, DISTANCES = (0.60, 0.66), (1.4, 2.9)
# Standard deviation of what is added to values from 0 to 255.
NOISE = 1.0
LIGHTS = (0.42, 0.30, 0.20)


@numba.njit(cache=True)
def rasterize(corners, triangles, size, depth, seen, weights):
    """Nearest triangle of each sample, and the weights of its corners there.

    `corners` holds x and y in samples and the depth of each vertex.
    """
    for index in range(triangles.shape[0]):
        a, b, c = triangles[index]
        ax, ay, bx, by = corners[a, 0], corners[a, 1], corners[b, 0], corners[b, 1]
        cx, cy = corners[c, 0], corners[c, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        left, right = max(0, int(min(ax, bx, cx) - 1)), min(size - 1, int(max(ax, bx, cx) + 1))
        top, bottom = max(0, int(min(ay, by, cy) - 1)), min(size - 1, int(max(ay, by, cy) + 1))
        for row in range(top, bottom + 1):
            y = row + 0.5
            for column in range(left, right + 1):
                x = column + 0.5
                of_a = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
                of_b = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
                of_c = 1.0 - of_a - of_b
                if min(of_a, of_b, of_c) < -1e-9:
                    continue
                of_a, of_b, of_c = of_a / corners[a, 2], of_b / corners[b, 2], of_c / corners[c, 2]
                here = 1.0 / (of_a + of_b + of_c)
                if here < depth[row, column]:
                    depth[row, column] = here
                    seen[row, column] = index
                    weights[row, column, 0] = of_a * here
                    weights[row, column, 1] = of_b * here
                    weights[row, column, 2] = of_c * here


def directions(count, random):
    """Spread evenly over the sphere, jittered, in random order."""
    place = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * place / count), np.pi * (1 + 5**0.5) * place
    rows = [np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)]
    spread = np.stack(rows, 1) + random.normal(0, 0.5 / math.sqrt(count), (count, 3))
    return random.permutation(spread / np.linalg.norm(spread, axis=1, keepdims=True))


def rotation(direction):
    """Axes of a camera in `direction` that looks at the origin: right, down, forward."""
    up = np.array([0.0, 0.0, 1.0]) if abs(direction[2]) < 0.95 else np.array([1.0, 0.0, 0.0])
    right = np.cross(-direction, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(-direction, right), -direction], 1)


def distance(box, turned, direction, fill):
    """From where a box fills so much of a picture's width or height."""
    near, far = 1.0, 6.0
    for _ in range(40):
        middle = 0.5 * (near + far)
        inside = (box - middle * direction) @ turned
        if inside[:, 2].min() > 0.05:
            extent = np.ptp(inside[:, :2] / inside[:, 2:], axis=0).max() * FOCAL / SIZE
            if extent < fill:
                far = middle
                continue
        near = middle
    return min(max(far, DISTANCES[0]), DISTANCES[1])


def pictures(mesh, count, seed):
    """Yields values and a camera-to-world matrix of each picture."""
    random = np.random.default_rng(seed)
    lights = random.normal(size=(3, 3))
    lights /= np.linalg.norm(lights, axis=1, keepdims=True)
    bounds = mesh.vertices.min(0), mesh.vertices.max(0)
    box = np.array(np.meshgrid(*zip(*bounds))).reshape(3, -1).T
    for direction in directions(count, random):
        turned = rotation(direction)
        away = distance(box, turned, direction, random.uniform(*FILLS))
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turned, away * direction
        yield picture(mesh, pose, lights, random), pose


def picture(mesh, pose, lights, random):
    turned, center = pose[:3, :3], pose[:3, 3]
    points = (mesh.vertices - center) @ turned
    size = SIZE * SAMPLES
    corners = (points[:, :2] / points[:, 2:] * FOCAL + SIZE / 2) * SAMPLES
    depth, seen = np.full((size, size), np.inf), np.full((size, size), -1)
    weights = np.zeros((size, size, 3))
    rasterize(np.column_stack([corners, points[:, 2]]), mesh.triangles, size, depth, seen, weights)
    covered = seen >= 0
    of = mesh.triangles[seen[covered]]
    mean = lambda values: np.einsum("nkc,nk->nc", values[of], weights[covered])
    normal = unit(mean(mesh.normals))
    sight = unit(center - mean(mesh.vertices))
    light = np.full(len(of), 0.12) + 0.15 * np.maximum(0, (normal * sight).sum(1))
    for direction, strength in zip(lights, LIGHTS):
        light += strength * np.maximum(0, normal @ direction)
        light += 0.05 * np.maximum(0, (normal * unit(sight + direction)).sum(1)) ** 20
    values = np.zeros((size, size))
    values[covered] = np.minimum(230 * light, 255)
    blocks = lambda of_samples: of_samples.reshape(SIZE, SAMPLES, SIZE, SAMPLES).mean((1, 3))
    values = blocks(values) + random.normal(0, NOISE, (SIZE, SIZE))
    return np.where(blocks(covered) > 0, np.clip(np.rint(values), 0, 255), 0).astype(np.uint8)


def unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
