"""Solids with a material each, put together to one exact surface."""

import dataclasses
import math

import numpy as np
from manifold3d import CrossSection, Manifold, OpType

ROUND = 48  # sides of a round thing


@dataclasses.dataclass
class Part:
    """Solids that turn and move together; `cuts` are taken out of its `walls`."""

    walls: list = dataclasses.field(default_factory=list)
    solids: list = dataclasses.field(default_factory=list)
    cuts: list = dataclasses.field(default_factory=list)

    def wall(self, solid, material):
        self.walls.append((solid, material))

    def add(self, solid, material):
        self.solids.append((solid, material))

    def cut(self, solid):
        self.cuts.append(solid)

    def join(self, other, turn=0.0, move=(0, 0, 0)):
        """Takes over another part, turned by degrees about z, then moved."""
        put = lambda solid: solid.rotate([0, 0, turn]).translate(list(move))
        self.walls += [(put(solid), material) for solid, material in other.walls]
        self.solids += [(put(solid), material) for solid, material in other.solids]
        self.cuts += [put(solid) for solid in other.cuts]

    def surface(self):
        """Vertices, triangles and the material of each triangle of the union of all."""
        cut = Manifold.batch_boolean(self.cuts, OpType.Add) if self.cuts else None
        walls = [(solid - cut if cut else solid, material) for solid, material in self.walls]
        named, originals = {}, []
        for solid, material in walls + self.solids:
            original = solid.as_original()
            named[original.original_id()] = material
            originals.append(original)
        mesh = Manifold.batch_boolean(originals, OpType.Add).to_mesh64()
        materials = []
        for run, original in enumerate(mesh.run_original_id):
            count = (mesh.run_index[run + 1] - mesh.run_index[run]) // 3
            materials += [named[original]] * int(count)
        return np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, int), materials


def box(low, high):
    """Between two corners, given in any order."""
    low, high = np.minimum(low, high), np.maximum(low, high)
    return Manifold.cube((high - low).tolist()).translate(low.tolist())


def along_y(outline, start, end):
    """An outline in x and z, drawn from one y to another."""
    solid = Manifold.extrude(outline_of(outline), end - start)
    return solid.rotate([90, 0, 0]).translate([0, end, 0])


def along_x(outline, start, end):
    """An outline in y and z, drawn from one x to another."""
    solid = Manifold.extrude(outline_of(outline), end - start)
    return solid.rotate([90, 0, 90]).translate([start, 0, 0])


def along_z(outline, start, end):
    return Manifold.extrude(outline_of(outline), end - start).translate([0, 0, start])


def outline_of(points):
    section = CrossSection([np.asarray(points, float)])
    return section if section.area() > 0 else CrossSection([np.asarray(points, float)[::-1]])


def cylinder(center, radius, height, top=None, sides=ROUND):
    """Upright, on a point; `top` is another radius there."""
    solid = Manifold.cylinder(height, radius, radius if top is None else top, sides)
    return solid.translate(list(center))


def arch(left, right, spring, sides=ROUND // 2):
    """Outline in x and z from z = 0 to a half circle over `spring`."""
    radius, middle = (right - left) / 2, (left + right) / 2
    turns = np.linspace(0, math.pi, sides + 1)
    round_top = [
        (middle + radius * math.cos(turn), spring + radius * math.sin(turn)) for turn in turns
    ]
    return [(left, 0), (right, 0), *round_top]


def raised(outline, by):
    return [(x, z + by) for x, z in outline]
