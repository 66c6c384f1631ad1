"""CAD-like things on a table, seen from a dome."""

import math

import numpy as np

from .solids import Part, along_y, along_z, box, cylinder

SCALE, FOCAL, VIEWS = 0.05, 1242.0, 32
MATERIALS = ["red", "green", "blue", "yellow", "oak", "metal", "plaster"]
TABLES = ["planks", "checks", "slate"]


def build(random):
    scene = Part()
    scene.add(box([-0.45, -0.35, -0.03], [0.45, 0.35, 0]), str(random.choice(TABLES)))
    scene.add(box([-2, -2, -0.75], [2, 2, -0.7]), "floor")
    kinds = random.permutation(
        [stairs, bracket, channel, prism, tower, plate, house, ring, wedge, cross]
    )[:8]
    spots = random.permutation([(x, y) for x in (-0.2, 0.0, 0.2) for y in (-0.14, 0.02, 0.16)])[
        : len(kinds)
    ]
    for kind, spot in zip(kinds, spots):
        solid = kind(random).rotate([0, 0, random.uniform(0, 360)])
        place = np.asarray(spot) + random.normal(0, 0.012, 2)
        scene.add(solid.translate([*place, 0]), str(random.choice(MATERIALS)))
    views = []
    for index in range(VIEWS):
        turn, up = index * math.pi * (3 - 5**0.5), math.radians(random.uniform(18, 65))
        away = random.uniform(0.75, 0.9)
        eye = [
            away * math.cos(up) * math.cos(turn),
            away * math.cos(up) * math.sin(turn),
            away * math.sin(up),
        ]
        views.append((eye, [random.normal(0, 0.02), random.normal(0, 0.02), 0.03]))
    return scene, [], views


def stairs(random):
    steps, run, rise, wide = (
        int(random.integers(2, 5)),
        random.uniform(0.018, 0.025),
        random.uniform(0.012, 0.02),
        random.uniform(0.05, 0.08),
    )
    outline = [(0, 0), (steps * run, 0)]
    for step in range(steps):
        outline += [
            ((steps - step) * run, (step + 1) * rise),
            ((steps - step - 1) * run, (step + 1) * rise),
        ]
    return along_y(outline, -wide / 2, wide / 2)


def bracket(random):
    long, high, wide, thick = (
        random.uniform(0.06, 0.09),
        random.uniform(0.05, 0.08),
        random.uniform(0.04, 0.06),
        0.01,
    )
    solid = box([0, -wide / 2, 0], [long, wide / 2, thick]) + box(
        [0, -wide / 2, 0], [thick, wide / 2, high]
    )
    hole = cylinder([long * 0.6, 0, -0.01], 0.009, 0.05)
    rib = along_y([(thick, thick), (long * 0.6, thick), (thick, high * 0.8)], -0.004, 0.004)
    return (solid + rib) - hole if random.random() < 0.5 else solid - hole


def channel(random):
    wide, high, long, thick = (
        random.uniform(0.04, 0.06),
        random.uniform(0.03, 0.05),
        random.uniform(0.06, 0.1),
        0.007,
    )
    outer, inner = (
        box([-wide / 2, 0, 0], [wide / 2, long, high]),
        box([-wide / 2 + thick, -1, thick], [wide / 2 - thick, 1, 1]),
    )
    return outer - inner


def prism(random):
    sides, radius = int(random.integers(3, 9)), random.uniform(0.025, 0.04)
    turns = 2 * math.pi * np.arange(sides) / sides
    return along_z(
        np.column_stack([radius * np.cos(turns), radius * np.sin(turns)]),
        0,
        random.uniform(0.04, 0.09),
    )


def tower(random):
    solid, base = cylinder([0, 0, 0], 0.03, 0.03), 0.03
    for radius in (0.022, 0.012)[: int(random.integers(1, 3))]:
        solid, base = solid + cylinder([0, 0, base], radius, 0.03), base + 0.03
    return solid


def plate(random):
    solid = box([-0.05, -0.035, 0], [0.05, 0.035, 0.012])
    for x in (-0.035, 0.035):
        for y in (-0.02, 0.02):
            solid -= cylinder([x, y, -0.01], 0.006, 0.05)
    return solid + box([-0.02, -0.02, 0], [0.02, 0.02, random.uniform(0.03, 0.05)])


def house(random):
    return along_y(
        [(-0.03, 0), (0.03, 0), (0.03, 0.03), (0, random.uniform(0.045, 0.06)), (-0.03, 0.03)],
        -0.04,
        0.04,
    )


def ring(random):
    outer, high = random.uniform(0.03, 0.04), random.uniform(0.02, 0.05)
    return cylinder([0, 0, 0], outer, high) - cylinder([0, 0, -0.01], outer * 0.6, high + 0.02)


def wedge(random):
    return along_y(
        [(-0.04, 0), (0.04, 0), (0.04, 0.008), (-0.04, random.uniform(0.03, 0.05))], -0.025, 0.025
    )


def cross(random):
    arm, long, high = 0.012, random.uniform(0.035, 0.045), random.uniform(0.02, 0.06)
    return box([-long, -arm, 0], [long, arm, high]) + box([-arm, -long, 0], [arm, long, high])
