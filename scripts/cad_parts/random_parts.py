"""Parts that nobody drew: a random sketch, extruded or turned, and two to six features on it, as
people model, another part for each seed. They say what a rule is worth where no one chose the
scene."""

import math

import numpy as np
from build123d import *  # noqa: F403, the language of these parts

MOST_EDGES = 150
SHORTEST_EDGE = 0.012  # Of the part's extent: five pixels of a picture.


def part(seed):
    """The part of a seed, as functions of `shapes` make theirs."""
    rng = np.random.default_rng(seed)
    made = base(rng)
    for feature in rng.choice(FEATURES, rng.integers(2, 7)):
        made = with_feature(rng, made, feature)
    with BuildPart() as p:
        add(made)
    return p


def with_feature(rng, made, feature):
    """The part with the feature at the first of five places where it leaves one sound solid."""
    for _ in range(5):
        try:
            trial = feature(rng, made)
            if sound(trial) and abs(trial.volume / made.volume - 1) > 0.002:
                return trial
        except Exception:  # OpenCASCADE and build123d have no common base for what fails here.
            pass
    return made


def sound(made):
    """One solid, without a cavity that nobody sees."""
    edges = made.edges()
    extent = max(made.bounding_box().size)
    return (
        len(made.shells()) == 1
        and made.is_valid()
        and len(edges) <= MOST_EDGES
        and min(edge.length for edge in edges) > SHORTEST_EDGE * extent
    )


def millimetres(rng, low, high):
    return float(rng.integers(round(low), max(round(high), round(low)) + 1))


def base(rng):
    if rng.random() < 0.2:
        return turned(rng)
    width, depth = millimetres(rng, 30, 100), millimetres(rng, 25, 80)
    return extrude(sketch(rng, width, depth), millimetres(rng, 8, 50))


def turned(rng):
    """Two to four steps of a shaft, hollow or not."""
    height, outline = 0.0, []
    for _ in range(rng.integers(2, 5)):
        radius, length = millimetres(rng, 8, 35), millimetres(rng, 6, 30)
        top = radius if rng.random() < 0.8 else max(radius - length / 2, 5)
        if outline[-1:] != [(radius, height)]:
            outline.append((radius, height))
        outline.append((top, height + length))
        height += length
    bore = 0.0 if rng.random() < 0.5 else 3.0
    profile = Polyline((bore, 0), *outline, (bore, height), close=True)
    return revolve(Plane.XZ * make_face(profile), Axis.Z)


def sketch(rng, width, depth):
    """A closed outline in a box around the origin."""
    least = min(width, depth)
    cut = lambda: millimetres(rng, 0.2 * least, 0.5 * least)
    box = Rectangle(width, depth)
    kind = rng.integers(9)
    if kind == 0:
        return Circle(least / 2)
    if kind == 1:
        return RegularPolygon(least / 2, int(rng.integers(3, 9)))
    if kind == 2:
        return RectangleRounded(width, depth, 0.25 * cut() + 0.05 * least)
    if kind == 3 and width > 1.1 * depth:
        return SlotOverall(width, depth)
    if kind == 4:  # An L.
        return box - Pos(width / 2, depth / 2) * Rectangle(2 * cut(), 2 * cut())
    if kind == 5:  # A T or a U.
        notches = [Pos(side * width / 2, depth / 2) for side in (-1, 1)]
        if rng.random() < 0.5:
            return box - [at * Rectangle(0.6 * width, depth) for at in notches]
        return box - Pos(0, depth / 2) * Rectangle(0.5 * width, 2 * cut())
    if kind == 6:  # Corners around a circle.
        angles = np.sort(rng.uniform(0, 2 * math.pi, rng.integers(4, 7)))
        if max(np.diff(angles, append=angles[0] + 2 * math.pi)) < 2.8:
            return Polygon(*[(width / 2 * math.cos(a), depth / 2 * math.sin(a)) for a in angles])
    return box


def planar_face(rng, made):
    """A planar face, the larger the likelier, the plane on it, and its width and depth there."""
    faces = made.faces().filter_by(GeomType.PLANE)
    areas = np.array([face.area for face in faces])
    face = faces[rng.choice(len(faces), p=areas / areas.sum())]
    longest = face.edges().sort_by(Edge.length)[-1]
    plane = Plane(face.center(), x_dir=longest % 0.5, z_dir=face.normal_at())
    size = plane.to_local_coords(face).bounding_box().size
    return face, plane, size.X, size.Y


def outline_on(rng, made):
    """A sketch on a planar face."""
    _, plane, width, depth = planar_face(rng, made)
    outline = sketch(rng, rng.uniform(0.2, 0.8) * width, rng.uniform(0.2, 0.8) * depth)
    return plane * place(rng, width, depth) * outline


def place(rng, width, depth):
    """The middle of a face, or somewhere in its middle half."""
    if rng.random() < 0.5:
        return Pos(0, 0)
    return Pos(round(rng.uniform(-0.25, 0.25) * width), round(rng.uniform(-0.25, 0.25) * depth))


def boss(rng, made):
    return made + extrude(outline_on(rng, made), millimetres(rng, 4, 25))


def pocket(rng, made):
    return made - extrude(outline_on(rng, made), -millimetres(rng, 3, 20))


def holes(rng, made):
    """One hole, four in a rectangle or some around a circle, through or blind, stepped or not."""
    _, plane, width, depth = planar_face(rng, made)
    least = min(width, depth)
    radius = millimetres(rng, 2, max(0.15 * least, 2))
    around = rng.integers(3)
    if around == 0:
        places = [place(rng, width, depth)]
    elif around == 1:
        places = GridLocations(rng.uniform(0.5, 0.8) * width, rng.uniform(0.5, 0.8) * depth, 2, 2)
    else:
        places = PolarLocations(rng.uniform(0.3, 0.4) * least, int(rng.integers(3, 7)))
    deep = 300 if rng.random() < 0.7 else millimetres(rng, 4, 20)
    tool = Pos(0, 0, -deep / 2) * Cylinder(radius, deep)
    if rng.random() < 0.2:
        tool += Pos(0, 0, -1.5) * Cylinder(1.6 * radius, 3)
    return made - [plane * at * tool for at in places]


def groove(rng, made):
    """A slot or a step across the whole part."""
    _, plane, width, depth = planar_face(rng, made)
    wide = rng.uniform(0.1, 0.4) * depth
    aside = rng.choice([0, 0.25, 0.5]) * depth
    deep = 2 * millimetres(rng, 3, 15)
    return made - plane * Pos(0, round(aside)) * Box(400, round(wide), deep)


def along(rng, made):
    """Straight edges of one direction, all, or those at one end."""
    lines = made.edges().filter_by(GeomType.LINE)
    lines = lines.filter_by(Axis((0, 0, 0), lines[rng.integers(len(lines))] % 0.5))
    if rng.random() < 0.5:
        return lines
    return lines.group_by(rng.choice([Axis.X, Axis.Y, Axis.Z]))[-1]


def chamfered(rng, made):
    return chamfer(along(rng, made), millimetres(rng, 2, 6))


def rounded(rng, made):
    return fillet(along(rng, made), millimetres(rng, 2, 8))


def rims_chamfered(rng, made):
    return chamfer(made.edges().filter_by(GeomType.CIRCLE).group_by(Axis.Z)[-1], 2)


def hollow(rng, made):
    face, *_ = planar_face(rng, made)
    return offset(made, -millimetres(rng, 2, 5), openings=face, kind=Kind.INTERSECTION)


FEATURES = [
    boss, boss, boss, pocket, pocket, holes, holes, holes, groove, groove, chamfered, rounded,
    rims_chamfered, hollow,
]  # fmt: skip
