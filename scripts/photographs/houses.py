"""A detached house in a garden, walked around at two heights."""

import math

import numpy as np
from manifold3d import Manifold

from . import plants
from .openings import door, window
from .solids import Part, along_x, along_y, box, cylinder

WALLS = ["brick", "plaster", "siding", "pale brick"]
SCALE, FOCAL, VIEWS = 1.0, 864.0, 32


def build(random):
    scene = Part()
    width, depth = random.uniform(9, 13), random.uniform(6.5, 9)
    floors = int(random.integers(1, 3))
    storey = random.uniform(2.6, 3.0)
    height = storey * floors + 0.3
    walls = str(random.choice(WALLS))
    scene.wall(box([-width / 2, -depth / 2, 0], [width / 2, depth / 2, height]), walls)
    plinth = random.uniform(0.02, 0.06)
    scene.add(
        box(
            [-width / 2 - plinth, -depth / 2 - plinth, 0],
            [width / 2 + plinth, depth / 2 + plinth, 0.35],
        ),
        "stone",
    )
    sides = [
        (0, width, depth / 2),
        (90, depth, width / 2),
        (180, width, depth / 2),
        (270, depth, width / 2),
    ]
    for side, (turn, length, away) in enumerate(sides):
        face = wall_face(random, length, floors, storey, side == 0)
        angle = math.radians(turn)
        scene.join(face, turn, [away * math.sin(angle), -away * math.cos(angle), 0])
    roof(scene, random, width, depth, height, walls)
    if random.random() < 0.6:
        annex(scene, random, width, depth, walls)
    if random.random() < 0.6:
        fence(scene, random, width, depth)
    scene.add(box([-60, -60, -1], [60, 60, 0]), "grass")
    scene.add(box([-0.9, -depth / 2 - 14, -0.5], [0.9, -depth / 2, 0.04]), "paving")
    leaves = []
    for _ in range(int(random.integers(2, 5))):
        place = around(random, 8.5, 11.5)
        scene.add(cylinder([*place, 0], 0.16, 2.6, 0.1, 12), "bark")
        leaves.append(plants.crown(random, [*place, 3.6], 1.5, 900))
    for _ in range(int(random.integers(2, 6))):
        leaves.append(plants.crown(random, [*around(random, 7, 9), 0.4], 0.6, 500))
    return scene, leaves, cameras(random)


def around(random, near, far):
    turn, away = random.uniform(0, 2 * math.pi), random.uniform(near, far)
    return away * math.cos(turn), away * math.sin(turn)


def wall_face(random, length, floors, storey, front):
    """Windows, bands and a door of one side; outside is -y, the wall stands in y = 0."""
    face = Part()
    count = max(1, int(length // random.uniform(2.4, 3.2)))
    bars = (int(random.integers(1, 4)), int(random.integers(1, 4)))
    size = random.uniform(0.9, 1.3), random.uniform(1.1, 1.5)
    lintel = bool(random.random() < 0.6)
    middles = (np.arange(count) + 0.5) / count * length - length / 2
    for floor in range(floors):
        for index, middle in enumerate(middles):
            if front and floor == 0 and index == count // 2:
                face.join(door(random), move=[middle, 0, 0.15])
                face.add(box([middle - 0.9, -1.1, 0], [middle + 0.9, 0, 0.15]), "stone")
            elif random.random() < 0.85:
                sill = floor * storey + 0.95
                face.join(window(*size, *bars, lintel=lintel), move=[middle, 0, sill])
    if floors > 1 and random.random() < 0.5:
        face.add(
            box([-length / 2 - 0.04, -0.05, storey + 0.1], [length / 2 + 0.04, 0.1, storey + 0.3]),
            "stone",
        )
    return face


def roof(scene, random, width, depth, height, walls):
    over, thick = random.uniform(0.25, 0.6), random.uniform(0.12, 0.22)
    kind = random.choice(["gable", "gable", "hip", "flat"])
    if kind == "flat":
        rim = random.uniform(0.15, 0.4)
        scene.add(
            box(
                [-width / 2 - over, -depth / 2 - over, height],
                [width / 2 + over, depth / 2 + over, height + 0.25],
            ),
            "plaster",
        )
        scene.add(
            box(
                [-width / 4, -depth / 4, height + 0.2], [width / 6, depth / 5, height + 0.25 + rim]
            ),
            "metal",
        )
        return
    slope = math.tan(math.radians(random.uniform(28, 45)))
    rise = slope * depth / 2
    if kind == "gable":
        scene.wall(
            along_x(
                [(-depth / 2, height - 0.01), (depth / 2, height - 0.01), (0, height + rise)],
                -width / 2,
                width / 2,
            ),
            walls,
        )
        reach = depth / 2 + over
        lower = height - slope * over
        outline = [
            (-reach, lower),
            (0, height + rise),
            (reach, lower),
            (reach, lower + thick),
            (0, height + rise + thick * 1.2),
            (-reach, lower + thick),
        ]
        scene.add(along_x(outline, -width / 2 - over, width / 2 + over), "tiles")
        for side in (-1, 1):
            if rise > 2.2:
                scene.join(
                    window(0.8, 0.9, 2, 2), turn=90 * side, move=[side * width / 2, 0, height + 0.2]
                )
        dormers(scene, random, depth, height, slope, thick)
    else:
        lower, reach_x, reach_y = height - 0.1, width / 2 + over, depth / 2 + over
        ridge = (width - depth) / 2
        top = lower + slope * reach_y
        corners = [
            [x * reach_x, y * reach_y, z]
            for z in (lower, lower + thick)
            for x in (-1, 1)
            for y in (-1, 1)
        ]
        ends = [[x * ridge, 0, top + thick] for x in (-1, 1)]
        scene.add(Manifold.hull_points(np.array(corners + ends)), "tiles")
    place = random.uniform(-0.3, 0.3) * width
    high = height + rise + random.uniform(0.5, 0.9)
    scene.add(box([place - 0.3, 0.5, height], [place + 0.3, 1.1, high]), "brick")
    scene.add(box([place - 0.37, 0.43, high], [place + 0.37, 1.17, high + 0.1]), "stone")


def dormers(scene, random, depth, height, slope, thick):
    for place in [[], [0.0], [-2.2, 2.2]][int(random.integers(0, 3))]:
        front = -depth / 2 + 0.7
        low = height + slope * 0.5
        scene.wall(box([place - 0.75, front, low - 0.3], [place + 0.75, 0, low + 1.3]), "plaster")
        outline = [(-0.95, low + 1.25), (0.95, low + 1.25), (0, low + 1.9)]
        scene.add(along_y([(place + x, z) for x, z in outline], front - 0.15, 0), "tiles")
        scene.join(window(0.8, 0.9, 2, 2, sill=False), move=[place, front, low + 0.25])


def annex(scene, random, width, depth, walls):
    """A garage with a flat roof at one side."""
    long, deep, high = random.uniform(3, 4), random.uniform(4.5, 6), random.uniform(2.3, 2.7)
    start = width / 2 - 0.05
    scene.wall(box([start, -deep / 2, 0], [start + long, deep / 2, high]), walls)
    scene.add(
        box([start, -deep / 2 - 0.15, high], [start + long + 0.15, deep / 2 + 0.15, high + 0.2]),
        "metal",
    )
    gate = Part()
    gate.cut(box([-1.2, -0.1, 0], [1.2, 0.15, 2.1]))
    for panel in range(4):
        gate.add(box([-1.2, 0.06, panel * 0.525 + 0.02], [1.2, 0.3, panel * 0.525 + 0.5]), "paint")
    scene.join(gate, move=[start + long / 2, -deep / 2, 0])


def fence(scene, random, width, depth):
    y = -depth / 2 - random.uniform(3.5, 4.5)
    for post in np.arange(-width / 2 - 2, width / 2 + 2, random.uniform(0.9, 1.6)):
        if abs(post) > 1.2:
            scene.add(box([post - 0.05, y - 0.05, 0], [post + 0.05, y + 0.05, 1.0]), "white wood")
    for low, high in [(-width / 2 - 2, -1.2), (1.2, width / 2 + 2)]:
        for z in (0.35, 0.8):
            scene.add(box([low, y - 0.02, z], [high, y + 0.02, z + 0.1]), "white wood")


def cameras(random):
    """Centres and what they look at."""
    views = []
    for ring, (count, high) in enumerate([(VIEWS // 2, 1.7), (VIEWS - VIEWS // 2, 5.6)]):
        for index in range(count):
            turn = 2 * math.pi * (index + 0.5 * ring) / count + random.normal(0, 0.05)
            away = random.uniform(12.5, 15)
            eye = [away * math.cos(turn), away * math.sin(turn), high + random.normal(0, 0.1)]
            views.append(
                (eye, [random.normal(0, 0.4), random.normal(0, 0.4), 2.9 + random.normal(0, 0.2)])
            )
    return views
