"""A furnished room, photographed from within."""

import math

import numpy as np

from .openings import door, window
from .solids import Part, along_x, box, cylinder

SCALE, FOCAL, VIEWS = 0.3, 700.0, 32
WALLS = ["plaster", "ochre plaster", "white paint", "pale brick"]
FLOORS = ["planks", "checks", "slate"]
WOODS = ["oak", "white wood", "dark metal", "paint"]
COLOURS = ["red", "green", "blue", "yellow", "white paint", "oak", "slate"]
WALL = 0.25


def build(random):
    scene = Part()
    width, depth = random.uniform(4.2, 6.0), random.uniform(3.4, 4.6)
    height = random.uniform(2.4, 2.9)
    half = np.array([width / 2, depth / 2])
    walls = str(random.choice(WALLS))
    outer = box([*-half - WALL, -0.2], [*half + WALL, height + 0.2])
    scene.wall(outer - box([*-half, 0], [*half, height]), walls)
    scene.add(box([*-half, -0.1], [*half, 0.0]), str(random.choice(FLOORS)))
    scene.add(box([*-half, height], [*half, height + 0.1]), "white paint")
    skirting = random.uniform(0.06, 0.12)
    # Openings face into the room: their outside, -y, is the room's inside.
    inside = [(0, depth / 2), (90, width / 2), (180, depth / 2), (270, width / 2)]
    lengths = [width, depth, width, depth]
    doors = int(random.integers(0, 4))
    for side, ((turn, away), length) in enumerate(zip(inside, lengths)):
        angle = math.radians(turn)
        face = wall_face(random, length, height, skirting, side == doors)
        scene.join(face, turn, [-away * math.sin(angle), away * math.cos(angle), 0])
    furnish(scene, random, half)
    lamp(scene, random, height)
    return scene, [], cameras(random, half)


def wall_face(random, length, height, skirting, with_door):
    """What is on one wall, which stands in y = 0 with the room at -y."""
    face = Part()
    middles = [-length / 4, length / 4]
    for index, middle in enumerate(middles):
        what = "door" if with_door and index == 0 else str(random.choice(["window", "picture", ""]))
        if what == "door":
            face.join(door(random, width=0.9, height=2.0), move=[middle, 0, 0])
        elif what == "window":
            face.join(opening(random), move=[middle, 0, 0.9])
        elif what == "picture":
            face.join(picture(random), move=[middle, 0, random.uniform(1.2, 1.5)])
    start, end = -length / 2, length / 2
    gaps = [(middles[0] - 0.55, middles[0] + 0.55)] if with_door else []
    for low, high in zip([start, *(gap[1] for gap in gaps)], [*(gap[0] for gap in gaps), end]):
        face.add(box([low, -0.015, 0], [high, 0.05, skirting]), "white wood")
    if random.random() < 0.4:
        face.add(box([start, -0.06, height - 0.06], [end, 0.05, height + 0.05]), "white paint")
    return face


def opening(random):
    """A window without panes, through which light falls."""
    wide, high = random.uniform(0.9, 1.4), random.uniform(1.0, 1.3)
    columns, rows = int(random.integers(1, 3)), int(random.integers(1, 3))
    part = window(wide, high, columns, rows, depth=0.14, sill=random.random() < 0.7)
    part.solids = [(solid, material) for solid, material in part.solids if material != "glass"]
    part.cuts = [box([-wide / 2, -0.2, 0], [wide / 2, 1.0, high])]
    return part


def picture(random):
    part, wide, high = Part(), random.uniform(0.3, 0.8), random.uniform(0.3, 0.7)
    rim = random.uniform(0.02, 0.05)
    part.add(
        box([-wide / 2, -0.02, 0], [wide / 2, 0.05, high])
        - box([-wide / 2 + rim, -1, rim], [wide / 2 - rim, -0.008, high - rim]),
        str(random.choice(WOODS)),
    )
    part.add(
        box([-wide / 2 + rim, -0.008, rim], [wide / 2 - rim, 0.05, high - rim]),
        str(random.choice(COLOURS)),
    )
    return part


def furnish(scene, random, half):
    """Along the walls and in the middle, where nothing else stands."""
    along = [shelf, cabinet, bed, desk, sofa]
    places = [(0, 0.5), (0, -0.5), (180, 0.5), (180, -0.5), (90, 0.0), (270, 0.0)]
    for index, kind in zip(random.permutation(len(places)), random.permutation(along)):
        turn, share = places[index]
        side = 1 if turn in (90, 270) else 0
        angle = math.radians(turn)
        normal = np.array([-math.sin(angle), math.cos(angle)])
        across = np.array([math.cos(angle), math.sin(angle)])
        spot = normal * (half[1 - side] - 0.04) + across * share * half[side]
        scene.join(kind(random), turn, [*spot, 0])
    middle = [random.normal(0, 0.15), random.normal(0, 0.15), 0]
    turn = random.uniform(0, 90)
    scene.add(
        box([-1.0, -0.7, 0], [1.0, 0.7, 0.012]).rotate([0, 0, turn]).translate(middle),
        str(random.choice(COLOURS)),
    )
    scene.join(table(random), turn, middle)


def legs(part, wide, deep, high, thick, material, front):
    for x in (-wide / 2 + thick, wide / 2 - thick):
        for y in (front + thick, front + deep - thick):
            half = thick / 2
            part.add(box([x - half, y - half, 0], [x + half, y + half, high]), material)


def table(random):
    part, wide, deep = Part(), random.uniform(1.0, 1.5), random.uniform(0.6, 0.9)
    high, material = random.uniform(0.7, 0.76), str(random.choice(WOODS))
    if random.random() < 0.3:
        part.add(cylinder([0, 0, high - 0.03], deep * 0.6, 0.03), material)
        part.add(cylinder([0, 0, 0], 0.05, high), "dark metal")
    else:
        part.add(box([-wide / 2, -deep / 2, high - 0.03], [wide / 2, deep / 2, high]), material)
        legs(part, wide, deep, high - 0.02, 0.05, material, -deep / 2)
    for _ in range(int(random.integers(1, 4))):
        x, y = random.uniform(-0.3, 0.3, 2) * [wide, deep]
        size = random.uniform(0.08, 0.25, 3)
        thing = box([-size[0] / 2, -size[1] / 2, -0.01], [size[0] / 2, size[1] / 2, size[2]])
        thing = thing.rotate([0, 0, random.uniform(0, 90)]).translate([x, y, high])
        part.add(thing, str(random.choice(COLOURS)))
    for side in (-1, 1):
        part.join(chair(random), 90 + 90 * side, [0, side * (deep / 2 + 0.15), 0])
    return part


def chair(random):
    """Looks along y; its back at -y."""
    part, material = Part(), str(random.choice(WOODS))
    part.add(box([-0.21, -0.21, 0.43], [0.21, 0.21, 0.46]), material)
    legs(part, 0.42, 0.42, 0.44, 0.04, material, -0.21)
    part.add(box([-0.21, -0.21, 0.44], [-0.17, -0.17, 0.92]), material)
    part.add(box([0.17, -0.21, 0.44], [0.21, -0.17, 0.92]), material)
    for low in (0.62, 0.78):
        part.add(box([-0.21, -0.2, low], [0.21, -0.18, low + 0.1]), material)
    return part


def shelf(random):
    part, wide, high = Part(), random.uniform(0.8, 1.2), random.uniform(1.6, 2.1)
    material, deep, board = str(random.choice(WOODS)), 0.3, 0.025
    for x in (-wide / 2, wide / 2 - board):
        part.add(box([x, -deep, 0], [x + board, 0.02, high]), material)
    part.add(box([-wide / 2, -0.02, 0], [wide / 2, 0.02, high]), material)
    floors = int(random.integers(4, 7))
    for level in range(floors + 1):
        z = 0.05 + (high - 0.05 - board) * level / floors
        part.add(box([-wide / 2, -deep, z], [wide / 2, 0.02, z + board]), material)
        x, end = -wide / 2 + board, wide / 2 - board
        while level < floors and x < end - 0.06:
            thick, tall = random.uniform(0.02, 0.06), random.uniform(0.16, 0.24)
            if random.random() < 0.75:
                near = -deep + random.uniform(0.02, 0.08)
                book = box([x, near, z + board / 2], [x + thick, 0.0, z + board + tall])
                part.add(book, str(random.choice(COLOURS)))
            x += thick + (0.0 if random.random() < 0.7 else 0.1)
    return part


def cabinet(random):
    part, wide, high = Part(), random.uniform(0.8, 1.3), random.uniform(0.7, 1.1)
    material, deep = str(random.choice(WOODS)), random.uniform(0.4, 0.5)
    part.add(box([-wide / 2, -deep, 0.08], [wide / 2, 0.02, high]), material)
    columns, rows = int(random.integers(1, 4)), int(random.integers(1, 4))
    for column in range(columns):
        for row in range(rows):
            left = -wide / 2 + wide * column / columns
            low = 0.08 + (high - 0.08) * row / rows
            right, top = left + wide / columns, low + (high - 0.08) / rows
            front = box([left + 0.01, -deep - 0.018, low + 0.01], [right - 0.01, -0.1, top - 0.01])
            part.add(front, material)
            middle = (left + right) / 2
            handle = box(
                [middle - 0.05, -deep - 0.04, top - 0.06], [middle + 0.05, -0.1, top - 0.045]
            )
            part.add(handle, "metal")
    return part


def bed(random):
    part, wide, long = Part(), random.uniform(0.9, 1.4), 2.0
    part.add(box([-wide / 2, -long, 0.1], [wide / 2, 0.02, 0.32]), str(random.choice(WOODS)))
    part.add(box([-wide / 2 - 0.02, -0.05, 0], [wide / 2 + 0.02, 0.02, 0.9]), "oak")
    mattress = box([-wide / 2 + 0.02, -long + 0.02, 0.3], [wide / 2 - 0.02, -0.05, 0.48])
    part.add(mattress, str(random.choice(COLOURS)))
    part.add(box([-0.3, -0.5, 0.46], [0.3, -0.12, 0.58]), "white paint")
    return part


def desk(random):
    part, wide, high = Part(), random.uniform(1.1, 1.5), 0.73
    material = str(random.choice(WOODS))
    part.add(box([-wide / 2, -0.65, high - 0.028], [wide / 2, 0.02, high]), material)
    legs(part, wide, 0.65, high - 0.02, 0.05, material, -0.65)
    part.add(box([-0.12, -0.3, high - 0.01], [0.12, -0.15, high + 0.012]), "dark metal")
    part.add(box([-0.03, -0.24, high], [0.03, -0.21, high + 0.15]), "dark metal")
    part.add(box([-0.3, -0.26, high + 0.1], [0.3, -0.235, high + 0.45]), "dark metal")
    part.add(box([-0.22, -0.5, high - 0.01], [0.22, -0.36, high + 0.02]), "slate")
    drawers = box([wide / 2 - 0.5, -0.6, 0.1], [wide / 2 - 0.1, -0.05, high - 0.01])
    part.add(drawers, str(random.choice(COLOURS)))
    return part


def sofa(random):
    part, wide, colour = Part(), random.uniform(1.4, 1.9), str(random.choice(COLOURS))
    part.add(box([-wide / 2, -0.85, 0.08], [wide / 2, 0.02, 0.4]), colour)
    part.add(
        along_x([(-0.25, 0.2), (0.02, 0.2), (0.02, 0.85), (-0.12, 0.85)], -wide / 2, wide / 2),
        colour,
    )
    for x in (-wide / 2, wide / 2 - 0.18):
        part.add(box([x, -0.85, 0.08], [x + 0.18, 0.02, 0.6]), colour)
    for x in (-wide / 4, wide / 4):
        half = wide / 4 - 0.1
        part.add(box([x - half, -0.82, 0.38], [x + half, -0.2, 0.5]), colour)
    return part


def lamp(scene, random, height):
    for x in (-1.0, 1.0):
        place = [x + random.normal(0, 0.1), random.normal(0, 0.1)]
        scene.add(cylinder([*place, height - 0.5], 0.01, 0.55), "dark metal")
        scene.add(cylinder([*place, height - 0.55], 0.16, 0.12), "lamp")


def cameras(random, half):
    """From all around the room across it, at three heights."""
    views = []
    for index in range(VIEWS):
        turn = 2 * math.pi * index / VIEWS * 3 + random.normal(0, 0.1)
        out = np.array([math.cos(turn), math.sin(turn)])
        share = random.uniform(0.55, 0.8)
        eye = out / max(abs(out) / half) * share
        aim = -out @ rotation(random.uniform(-0.7, 0.7))
        high = [1.3, 1.6, 1.9][index % 3] + random.normal(0, 0.05)
        views.append(([*eye, high], [*(eye + 2 * aim), high - random.uniform(0.1, 0.9)]))
    return views


def rotation(angle):
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
