"""Leaves: they hide what is behind them and have no true edges."""

import numpy as np


def crown(random, center, radius, count):
    """Vertices and triangles of quads in a ball of clumps."""
    clumps = random.normal(size=(12, 3))
    clumps *= (
        radius * random.uniform(0.3, 1.0, (12, 1)) / np.linalg.norm(clumps, axis=1, keepdims=True)
    )
    place = clumps[random.integers(0, 12, count)] + random.normal(0, radius / 4, (count, 3))
    one = random.normal(size=(count, 3))
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    two = np.cross(one, random.normal(size=(count, 3)))
    two /= np.linalg.norm(two, axis=1, keepdims=True)
    size = random.uniform(0.05, 0.11, (count, 1))
    corners = [
        place + size * (a * one + b * two) for a, b in ((-1, 0), (0, -0.5), (1, 0), (0, 0.5))
    ]
    vertices = np.stack(corners, 1).reshape(-1, 3) + np.asarray(center)
    vertices[:, 2] = np.maximum(vertices[:, 2], 0.02)
    first = 4 * np.arange(count)[:, None]
    return vertices, np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
