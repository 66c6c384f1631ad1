"""A street façade, seen from the street only."""

import math

import numpy as np

from .openings import door, window
from .solids import Part, along_x, along_y, arch, box, cylinder

SCALE, FOCAL, VIEWS = 1.0, 669.6, 15
WALLS = ["brick", "plaster", "stone blocks", "ochre plaster"]


def build(random):
    scene = Part()
    bays, floors = int(random.integers(4, 7)), int(random.integers(3, 5))
    bay, ground, storey = (
        random.uniform(2.4, 3.2),
        random.uniform(3.6, 4.4),
        random.uniform(3.0, 3.5),
    )
    width, height = bays * bay, ground + floors * storey
    walls = str(random.choice(WALLS))
    scene.wall(box([-width / 2, 0, ground], [width / 2, 6, height]), walls)
    scene.wall(box([-width / 2, -0.08, 0], [width / 2, 6, ground]), "stone blocks")
    middles = (np.arange(bays) + 0.5 - bays / 2) * bay
    street_floor(scene, random, middles, bay, ground)
    for floor in range(floors):
        style = str(random.choice(["plain", "frame", "pediment", "round", "arched"]))
        balconies = random.random() < 0.5
        bars = int(random.integers(1, 4)), int(random.integers(2, 5))
        size = bay * random.uniform(0.36, 0.46), storey * random.uniform(0.5, 0.6)
        for index, middle in enumerate(middles):
            base = ground + floor * storey + 0.75
            scene.join(upper_window(*size, *bars, style), move=[middle, 0, base])
            if balconies and index % 2 == floor % 2:
                scene.join(balcony(random, bay * 0.75), move=[middle, 0, base - 0.35])
        if random.random() < 0.6:
            band(scene, width, ground + (floor + 1) * storey - 0.1, 0.2, 0.08)
    if random.random() < 0.6:
        for edge in (np.arange(bays + 1) - bays / 2) * bay:
            scene.add(box([edge - 0.2, -0.1, ground], [edge + 0.2, 0.1, height]), "stone")
    band(scene, width, ground, 0.3, 0.22)
    cornice(scene, random, width, height)
    for side in (-1, 1):
        neighbour = box(
            [side * width / 2, 0.5, 0],
            [side * (width / 2 + 8), 6, height * random.uniform(0.75, 0.95)],
        )
        scene.add(neighbour, "plaster")
    scene.add(box([-50, -3, -1], [50, 0.5, 0.12]), "paving")
    scene.add(box([-50, -50, -1], [50, 0.5, 0]), "asphalt")
    for lamp in (-width / 3, width / 4):
        scene.add(cylinder([lamp, -2.6, 0], 0.07, 3.6, 0.05), "dark metal")
        scene.add(cylinder([lamp, -2.6, 3.6], 0.12, 0.35, 0.2), "dark metal")
    return scene, [], cameras(random, width, height)


def street_floor(scene, random, middles, bay, ground):
    kind = random.choice(["arches", "shops"])
    for index, middle in enumerate(middles):
        if index == len(middles) // 2:
            entrance(scene, random, middle, ground)
        elif kind == "arches":
            scene.join(
                window(bay * 0.6, ground * 0.45, 2, 2, round_top=True), move=[middle, -0.08, 0.5]
            )
            outer, inner = (
                arch(-bay * 0.36, bay * 0.36, ground * 0.45),
                arch(-bay * 0.3, bay * 0.3, ground * 0.45),
            )
            ring = along_y(outer, -0.04, 0.1) - along_y(inner, -1, 1)
            scene.join(single(ring, "stone"), move=[middle, -0.1, 0.5])
        else:
            scene.join(window(bay * 0.7, ground * 0.6, 3, 1), move=[middle, -0.08, 0.5])
            scene.add(
                box(
                    [middle - bay * 0.4, -0.25, ground * 0.8], [middle + bay * 0.4, 0, ground * 0.9]
                ),
                "paint",
            )


def single(solid, material):
    part = Part()
    part.add(solid, material)
    return part


def entrance(scene, random, middle, ground):
    scene.join(door(random, 1.2, 2.4), move=[middle, -0.08, 0.12])
    for side in (-1, 1):
        scene.add(cylinder([middle + side * 1.0, -0.5, 0.1], 0.16, ground * 0.75, 0.13), "stone")
        scene.add(
            box([middle + side * 1.0 - 0.2, -0.7, 0.1], [middle + side * 1.0 + 0.2, -0.3, 0.35]),
            "stone",
        )
    scene.add(
        box([middle - 1.3, -0.75, ground * 0.75 + 0.1], [middle + 1.3, 0, ground * 0.75 + 0.4]),
        "stone",
    )
    for step in range(2):
        scene.add(
            box([middle - 1.4, -1.3 + 0.3 * step, 0], [middle + 1.4, 0, 0.12 * (step + 1)]), "stone"
        )


def upper_window(width, height, columns, rows, style):
    part = window(width, height, columns, rows, round_top=style == "arched", depth=0.2)
    half = width / 2 + 0.14
    if style in ("frame", "pediment", "round"):
        for side in (-1, 1):
            part.add(box([side * width / 2, -0.06, 0], [side * half, 0.1, height]), "stone")
        part.add(box([-half, -0.08, height], [half, 0.1, height + 0.18]), "stone")
    if style == "pediment":
        part.add(
            along_y(
                [(-half - 0.1, height + 0.18), (half + 0.1, height + 0.18), (0, height + 0.5)],
                -0.14,
                0.1,
            ),
            "stone",
        )
    if style == "round":
        turns = np.linspace(math.radians(30), math.radians(150), 20)
        radius = (half + 0.1) / math.cos(math.radians(30))
        rise = radius * math.sin(math.radians(30))
        part.add(
            along_y(
                [
                    (radius * math.cos(t), height + 0.18 - rise + radius * math.sin(t))
                    for t in turns
                ],
                -0.14,
                0.1,
            ),
            "stone",
        )
    return part


def balcony(random, width):
    part = Part()
    half, deep = width / 2, random.uniform(0.5, 0.8)
    part.add(box([-half, -deep, -0.15], [half, 0.05, 0]), "stone")
    for x in (-half + 0.15, half - 0.3):
        part.add(along_x([(0, -0.15), (0, -0.5), (-deep * 0.8, -0.15)], x, x + 0.15), "stone")
    rail = "dark metal" if random.random() < 0.5 else "stone"
    thick = 0.015 if rail == "dark metal" else 0.045
    part.add(box([-half, -deep, 0.85], [half, -deep + 0.1, 0.95]), rail)
    for side in (-1, 1):
        part.add(box([side * half, -deep, 0.85], [side * (half - 0.1), 0, 0.95]), rail)
    for x in np.linspace(-half + 0.06, half - 0.06, int(width / (0.12 if thick < 0.02 else 0.22))):
        part.add(
            box([x - thick, -deep + 0.02, -0.01], [x + thick, -deep + 0.02 + 2 * thick, 0.86]), rail
        )
    return part


def band(scene, width, z, high, deep):
    scene.add(box([-width / 2, -deep, z - high], [width / 2, 0.2, z]), "stone")


def cornice(scene, random, width, height):
    deep = random.uniform(0.4, 0.7)
    outline = [
        (0.3, height - 0.5),
        (-0.1, height - 0.5),
        (-0.1, height - 0.35),
        (-deep * 0.6, height - 0.15),
        (-deep * 0.6, height),
        (-deep, height),
        (-deep, height + 0.18),
        (0.3, height + 0.18),
    ]
    scene.add(along_x(outline, -width / 2, width / 2), "stone")
    for x in np.arange(-width / 2 + 0.3, width / 2 - 0.2, random.uniform(0.5, 0.8)):
        scene.add(box([x, -deep * 0.55, height - 0.32], [x + 0.16, 0, height - 0.05]), "stone")


def cameras(random, width, height):
    views = []
    for index in range(VIEWS):
        x = width * 1.1 * (index / (VIEWS - 1) - 0.5)
        eye = [x + random.normal(0, 0.2), -random.uniform(10, 13), 1.7 + random.normal(0, 0.05)]
        at = [0.55 * x + random.normal(0, 0.5), 0, height * 0.42 + random.normal(0, 0.4)]
        views.append((eye, at))
    return views
