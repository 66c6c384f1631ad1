#!/usr/bin/env python3
"""Opens what `export_all` has written with readers of other projects.

    read_exports.py WIREFRAME.json OUT

OUT is the folder that

    cargo run --release -p neat-export --example export_all -- WIREFRAME.json OUT

has filled. Every format must hold as many vertices and edges as WIREFRAME.json, the
same edges, and the same coordinates to 1e-6 of the wireframe's extent; and its arcs and splines,
as such or as chains of straight pieces, where the format has them. Closed shells must be valid
solids in STEP and CityJSON and watertight triangles elsewhere, of the volume that their loops
enclose; surfaces in CityJSON are what their normals say, and those of the house what it has.
Prints a line per file; the exit code is 1 if one differs. Needs scripts/requirements-readers.txt.
"""

import json
import math
import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path

import numpy as np

TOLERANCE = 1e-6
# Pieces of arcs and splines that are drawn as chains turn by no more, in radians.
TURN = 0.089
SCHEMA = Path(__file__).resolve().parent.parent / "docs" / "wireframe.schema.json"


# Junctions move onto the planes of their faces by what is noise, and chords cut off segments.
VOLUME_TOLERANCE = 0.01


class Arc:
    """A part of a circle, or a whole one, as wireframe.json has it."""

    def __init__(self, center, axes, radius, angles):
        self.center, self.axes = np.asarray(center, dtype=float), np.asarray(axes, dtype=float)
        self.radius, self.angles = radius, angles
        self.sweep = angles[1] - angles[0]
        self.is_closed = self.sweep > 2 * math.pi - 1e-9

    def points(self, shares):
        """At these shares of its length, [N, 3]."""
        angles = self.angles[0] + self.sweep * np.asarray(shares)[:, None]
        return self.center + self.radius * (np.cos(angles) * self.axes[0]
                                            + np.sin(angles) * self.axes[1])

    def chain(self):
        """Points of the straight pieces that draw it."""
        count = max(math.ceil(self.sweep / TURN), 1)
        return self.points(np.arange(count if self.is_closed else count + 1) / count)


class Spline:
    """A uniform cubic B-spline, as wireframe.json has it."""

    def __init__(self, controls, closed):
        self.controls, self.is_closed = np.asarray(controls, dtype=float), closed
        count = len(controls)
        self.pieces = count if closed else count - 3
        self.knots = np.arange(-3, self.pieces + 4)
        if closed:
            self.around = self.controls[np.arange(count + 3) % count]
        else:
            self.around, self.knots = self.controls, self.knots.clip(0, self.pieces)

    def points(self, places):
        """At these places from 0 to the number of pieces, [N, 3], by de Boor's algorithm."""
        def point(place):
            piece = min(int(place), self.pieces - 1)
            points = list(self.around[piece:piece + 4])
            for level in (1, 2, 3):
                for k in range(3, level - 1, -1):
                    low, high = self.knots[piece + k], self.knots[piece + k + 4 - level]
                    share = (place - low) / (high - low)
                    points[k] = (1 - share) * points[k - 1] + share * points[k]
            return points[3]

        return np.array([point(place) for place in places])

    def chain(self):
        """Points of the straight pieces that draw it."""
        places = [0.0]
        for piece in range(self.pieces):
            a, b, c, d = self.points(piece + np.arange(4) / 3)
            inner = [(-5 * a + 18 * b - 9 * c + 2 * d) / 6, (2 * a - 9 * b + 18 * c - 5 * d) / 6]
            legs = np.diff([a, *inner, d], axis=0)
            legs /= np.linalg.norm(legs, axis=-1, keepdims=True)
            turn = np.arccos((legs[1:] * legs[:-1]).sum(axis=-1)).sum()
            count = min(max(math.ceil(turn / TURN), 1), 64)
            places += (piece + np.arange(1, count + 1) / count).tolist()
        return self.points(places[:-1] if self.is_closed else places)


class Dome:
    """A part of a sphere around an axis, with the circle in which it ends."""

    def __init__(self, center, axis, radius, reach):
        axis = np.asarray(axis, dtype=float)
        across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        across /= np.linalg.norm(across)
        self.center = np.asarray(center) + radius * math.cos(reach) * axis
        self.axes = radius * math.sin(reach) * np.stack([across, np.cross(axis, across)])

    def points(self, shares):
        """Around it, counterclockwise as seen from beyond the pole."""
        angles = 2.0 * math.pi * np.asarray(shares)[:, None]
        return self.center + np.cos(angles) * self.axes[0] + np.sin(angles) * self.axes[1]


class Wireframe:
    """Vertices [V, 3], index pairs [E, 2], arcs, splines, shells and domes."""

    def __init__(self, vertices, edges, arcs=(), shells=(), name=None, splines=(), domes=()):
        self.vertices = np.asarray(vertices, dtype=float).reshape(-1, 3)
        self.edges = np.asarray(edges, dtype=int).reshape(-1, 2)
        self.arcs, self.splines, self.shells, self.name = arcs, splines, shells, name
        self.domes = domes

    def drawn(self):
        """With arcs and splines as chains of straight pieces, for formats without curves."""
        vertices, edges = self.vertices, self.edges
        for curve in [*self.arcs, *self.splines]:
            points = curve.chain()
            start = np.arange(len(points) if curve.is_closed else len(points) - 1)
            pieces = np.stack([start, (start + 1) % len(points)], axis=-1)
            edges = np.concatenate([edges, len(vertices) + pieces])
            vertices = np.concatenate([vertices, points])
        return Wireframe(vertices, edges, shells=self.shells, domes=self.domes)

    def extent(self):
        if len(self.vertices) == 0:
            return 1.0
        return max(float(np.ptp(self.vertices, axis=0).max()), 1e-300)

    def isolated(self):
        """Indices of the vertices without edges."""
        return sorted(set(range(len(self.vertices))) - set(self.edges.ravel().tolist()))

    def without(self, vertices=(), edges=()):
        """The same without some vertices and edges."""
        kept = [v for v in range(len(self.vertices)) if v not in set(vertices)]
        new_index = {old: new for new, old in enumerate(kept)}
        pairs = [[new_index[a], new_index[b]]
                 for i, (a, b) in enumerate(self.edges.tolist()) if i not in set(edges)]
        return Wireframe(self.vertices[kept], pairs, self.arcs, splines=self.splines)

    def without_faces(self):
        """What bounds no face."""
        steps = [step for shell in self.shells for face in shell["faces"]
                 for loop in face["loops"] for step in loop]
        edges, arcs, splines = ({step[kind] for step in steps if kind in step}
                                for kind in ("edge", "arc", "spline"))
        loose = Wireframe(self.vertices, self.edges,
                          [arc for i, arc in enumerate(self.arcs) if i not in arcs],
                          splines=[s for i, s in enumerate(self.splines) if i not in splines])
        return loose.without(edges=edges)


def volume(shell, wireframe):
    """What a closed shell encloses: a third of the flux of x through its faces."""
    def flux(face):
        if "plane" in face:
            area = sum((area_of_step(step, wireframe) for loop in face["loops"] for step in loop),
                       np.zeros(3))
            return face["plane"]["offset"] * float(np.dot(face["plane"]["normal"], area))
        if "sphere" in face:
            return flux_of_cap(face, wireframe)
        if "extruded" in face:
            return flux_of_wall(face, wireframe)
        if "patch" in face:
            return flux_of_patch(face, wireframe)
        return flux_of_round(face, wireframe)

    return sum(flux(face) for face in shell["faces"]) / 3.0


def flux_of_cap(face, wireframe):
    """Of x through a part of a sphere within a circle: an integral over the angle from its pole."""
    sphere = face["sphere"]
    center, radius = np.array(sphere["center"]), sphere["radius"]
    offsets = points_of_step(face["loops"][0][0], wireframe) - center
    turns = np.cross(offsets[:-1], offsets[1:]).sum(axis=0)
    sign = 1.0 if sphere["convex"] else -1.0
    pole = sign * turns / np.linalg.norm(turns)
    reach = math.acos(float((offsets @ pole).mean()) / radius)
    angles = (np.arange(4000) + 0.5) * reach / 4000
    rings = 2.0 * math.pi * radius**2 * np.sin(angles) * reach / 4000
    return sign * float((rings * (np.cos(angles) * (center @ pole) + radius)).sum())


def flux_of_wall(face, wireframe):
    """Of x through an extruded spline: an integral over its profile."""
    direction = np.array(face["extruded"]["direction"])
    total = 0.0
    for loop in face["loops"]:
        points = np.concatenate([points_of_step(step, wireframe) for step in loop])
        heights = 0.5 * (points[1:] + points[:-1]) @ direction
        total -= float((heights * (np.cross(points[:-1], points[1:]) @ direction)).sum())
    return total


def flux_of_patch(face, wireframe):
    """Of x through a Coons patch between four sides, by a fine grid; holes are known to lie on it."""
    first, *holes = face["loops"]
    steps, sides, count = list(first), [], 400
    for length in face["patch"]["sides"]:
        own, steps = steps[:length], steps[length:]
        chains = [points_of_step(step, wireframe) for step in own]
        # A side without steps is the point where the one before it ends.
        points = np.concatenate(chains) if chains else np.repeat(sides[-1][-1:], 2, axis=0)
        lengths = np.cumsum(np.r_[0.0, np.linalg.norm(np.diff(points, axis=0), axis=1)])
        at = np.linspace(0.0, lengths[-1], count + 1)
        sides.append(np.stack([np.interp(at, lengths, points[:, k]) for k in range(3)], 1))
    low, right, high, left = sides[0], sides[1], sides[2][::-1], sides[3][::-1]
    share = np.linspace(0.0, 1.0, count + 1)
    u, v = share[:, None, None], share[None, :, None]
    corners = ((1 - u) * low[0] + u * low[-1]) * (1 - v) + ((1 - u) * high[0] + u * high[-1]) * v
    grid = (1 - v) * low[:, None] + v * high[:, None] + (1 - u) * left + u * right - corners
    middle = 0.25 * (grid[1:, 1:] + grid[1:, :-1] + grid[:-1, 1:] + grid[:-1, :-1])
    normal = 0.5 * np.cross(grid[1:, 1:] - grid[:-1, :-1], grid[:-1, 1:] - grid[1:, :-1])
    inside = np.ones(middle.shape[:2], dtype=bool)
    for hole in holes:
        points = np.concatenate([points_of_step(step, wireframe)[:-1:20] for step in hole])
        nearest = [((grid - point) ** 2).sum(2).argmin() for point in points]
        places = np.stack(np.unravel_index(nearest, grid.shape[:2]), 1).astype(float)
        inside &= ~within(places, middle.shape[:2])
    return float(((middle * normal).sum(2) * inside).sum())


def within(polygon, shape):
    """Which cells of a grid have their middles in a polygon, by the even-odd rule."""
    rows, columns = np.meshgrid(np.arange(shape[0]) + 0.5, np.arange(shape[1]) + 0.5,
                                indexing="ij")
    inside = np.zeros(shape, dtype=bool)
    for (a, b), (c, d) in zip(polygon, np.roll(polygon, -1, axis=0)):
        if b != d:
            crosses = (b > columns) != (d > columns)
            inside ^= crosses & (rows < a + (columns - b) * (c - a) / (d - b))
    return inside


def flux_of_round(face, wireframe):
    """Of x through a cylinder or a cone: an integral over the angle around it."""
    surface = face.get("cylinder") or face["cone"]
    axis = np.array(surface["axis"])
    origin = np.array(surface.get("point") or surface["apex"])
    radius = surface.get("radius", 0.0)
    slope = math.tan(surface.get("half_angle", 0.0))
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    beside = np.cross(axis, across)
    total = 0.0
    for loop in face["loops"]:
        offsets = np.concatenate([points_of_step(step, wireframe) for step in loop]) - origin
        angles = np.unwrap(np.arctan2(offsets @ beside, offsets @ across))
        heights = offsets @ axis
        turns, angles = np.diff(angles), 0.5 * (angles[1:] + angles[:-1])
        heights = 0.5 * (heights[1:] + heights[:-1])
        outward = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * beside
        along = outward @ origin + radius - slope * (axis @ origin)
        total -= float((along * heights * (radius + 0.5 * slope * heights) * turns).sum())
    return total


def points_of_step(step, wireframe):
    """Points along a step of a loop, in its direction."""
    shares = np.linspace(0.0, 1.0, 1001)
    if "edge" in step:
        points = wireframe.vertices[wireframe.edges[step["edge"]]]
    elif "smooth" in step:
        points = wireframe.vertices[step["smooth"]]
    elif "rim" in step:
        points = wireframe.domes[step["rim"]].points(shares)
    elif "spline" in step:
        spline = wireframe.splines[step["spline"]]
        points = spline.points(shares * spline.pieces)
    else:
        points = wireframe.arcs[step["arc"]].points(shares)
    return points[::-1] if step.get("reversed") else points


def area_of_step(step, wireframe):
    """Half the integral of x × dx along it."""
    if "arc" not in step:
        points = points_of_step(step, wireframe)
        return 0.5 * np.cross(points[:-1], points[1:]).sum(axis=0)
    sign = -0.5 if step.get("reversed") else 0.5
    arc = wireframe.arcs[step["arc"]]
    start, end = arc.points([0.0, 1.0])
    swept = arc.radius**2 * arc.sweep * np.cross(*arc.axes)
    return sign * (np.cross(arc.center, end - start) + swept)


def check_volume(found, expected, what):
    total = sum(volume(shell, expected) for shell in expected.shells if shell["closed"])
    check(abs(found - total) <= VOLUME_TOLERANCE * abs(total),
          f"{what} of volume {found}, not {total}")


def check_mesh(vertices, triangles, expected):
    """Faces are triangles: with closed shells alone, watertight ones around their volume."""
    check((len(triangles) > 0) == (len(expected.shells) > 0), "shells and triangles")
    if expected.shells and all(shell["closed"] for shell in expected.shells):
        import trimesh

        mesh = trimesh.Trimesh(vertices, triangles, process=False)
        check(mesh.is_watertight and mesh.is_winding_consistent, "the mesh has holes")
        check_volume(mesh.volume, expected, "a mesh")


def check(condition, sentence):
    if not condition:
        raise AssertionError(sentence)


def check_close(found, expected, extent, what):
    check(found.shape == expected.shape, f"{what}: {found.shape}, not {expected.shape}")
    if found.size:
        worst = float(np.abs(found - expected).max())
        # A number itself is known to 1e-15 of its size only.
        limit = TOLERANCE * extent + 1e-15 * float(np.abs(expected).max())
        check(worst <= limit, f"{what} differ by {worst}, more than {limit}")


def same_graph(found, expected):
    """Vertices in the same order, edges in any order and direction. Behind them may be those of
    patches and domes, which only triangles have."""
    faces = [face for shell in expected.shells for face in shell["faces"]]
    has_patches = any("patch" in face or "sphere" in face
                      or any("rim" in step for loop in face["loops"] for step in loop)
                      for face in faces)
    kept = len(expected.vertices) if has_patches else None
    check_close(found.vertices[:kept], expected.vertices, expected.extent(), "vertices")

    def undirected(wireframe):
        return sorted(sorted(edge) for edge in wireframe.edges.tolist())

    check(undirected(found) == undirected(expected), "the edges join other vertices")


def same_lines(ends, expected, extent):
    """Ends [E, 2, 3] in the order and direction of the edges."""
    check_close(np.asarray(ends, dtype=float).reshape(-1, 2, 3),
                expected.vertices[expected.edges], extent, "ends of lines")


def same_arcs(found, expected):
    """Points [3, 3] at the begin, the middle and the end of arcs, in their order; circles, which
    begin where they like, as centre, normal of either sign and radius."""
    check(len(found) == len(expected.arcs), f"{len(found)} arcs, not {len(expected.arcs)}")
    for arc, (points, circle) in zip(expected.arcs, found):
        if arc.is_closed:
            center, normal, radius = circle
            expected_normal = np.cross(*arc.axes)
            normal = np.asarray(normal) * np.sign(np.dot(normal, expected_normal))
            check_close(np.asarray(center), arc.center, expected.extent(), "centre of a circle")
            check_close(normal, expected_normal, 1.0, "normal of a circle")
            check_close(np.asarray([radius]), np.asarray([arc.radius]), expected.extent(), "radius")
        else:
            points = np.asarray(points)
            if np.abs(points[0] - arc.points([0.0])).max() > np.abs(points[2] - arc.points([0.0])).max():
                points = points[::-1]
            check_close(points, arc.points([0.0, 0.5, 1.0]), expected.extent(), "points of an arc")


def same_splines(found, expected):
    """Points [N, 3] of splines in their order, at places evenly from end to end."""
    check(len(found) == len(expected.splines),
          f"{len(found)} splines, not {len(expected.splines)}")
    for spline, points in zip(expected.splines, found):
        places = np.linspace(0, spline.pieces, len(points))
        check_close(np.asarray(points), spline.points(places), expected.extent(),
                    "points of a spline")


def read_json(path, expected):
    import jsonschema

    document = json.loads(path.read_text())
    schema = json.loads(SCHEMA.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(document)
    for broken in ({}, {"junctions": [[0, 0]], "edges": []},
                   {"junctions": [], "edges": [[0, -1]]},
                   dict(document, views=[1]), dict(document, junction_covariances=[[0] * 5]),
                   dict(document, arcs=[{"center": [0, 0, 0], "radius": 1}]),
                   dict(document, domes=[{"center": [0, 0, 0], "radius": 1}]),
                   dict(document, splines=[{"controls": [[0, 0, 0]] * 3, "closed": False}])):
        check(not jsonschema.Draft202012Validator(schema).is_valid(broken),
              f"the schema accepts {str(broken)[:80]}")
    same_graph(Wireframe(document["junctions"], document["edges"]), expected)
    return "jsonschema"


def vtk_wireframe(data):
    """Points and two-point lines of a vtkPolyData."""
    from vtk.util.numpy_support import vtk_to_numpy

    lines = data.GetLines()
    edges = vtk_to_numpy(lines.GetConnectivityArray()) if lines.GetNumberOfCells() else []
    check(len(edges) == 2 * lines.GetNumberOfCells(), "lines of more than two points")
    points = data.GetPoints()
    count = points.GetNumberOfPoints() if points else 0
    return Wireframe(vtk_to_numpy(points.GetData()) if count else [], edges)


def read_obj(path, expected):
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    bare, expected = expected, expected.drawn()
    reader = vtk.vtkOBJReader()
    reader.SetFileName(str(path))
    reader.Update()
    found = vtk_wireframe(reader.GetOutput())
    same_graph(found, expected)
    polygons = reader.GetOutput().GetPolys()
    corners = vtk_to_numpy(polygons.GetConnectivityArray()) if polygons.GetNumberOfCells() else []
    check_mesh(found.vertices, np.reshape(corners, (-1, 3)), bare)
    return "VTK"


def read_ply(path, expected):
    from plyfile import PlyData

    bare, expected = expected, expected.drawn()
    ply = PlyData.read(str(path))
    vertex, edge = ply["vertex"], ply["edge"]
    vertices = np.stack([vertex[axis] for axis in "xyz"], axis=-1)
    edges = np.stack([edge["vertex1"], edge["vertex2"]], axis=-1)
    same_graph(Wireframe(vertices, edges), expected)
    faces = [list(face) for element in ply if element.name == "face"
             for face in element["vertex_indices"]]
    check_mesh(vertices, faces, bare)
    return "plyfile"


def read_gltf(path, expected):
    import pygltflib
    import vtk

    bare, expected = expected, expected.drawn()
    gltf = pygltflib.GLTF2().load(str(path))
    if len(expected.vertices) == 0:
        check(not gltf.nodes and not gltf.meshes, "an empty scene has nodes")
        return "pygltflib"

    def data(index):
        accessor = gltf.accessors[index]
        view = gltf.bufferViews[accessor.bufferView]
        if path.suffix == ".glb":
            blob = gltf.binary_blob()
        else:
            blob = gltf.get_data_from_buffer_uri(gltf.buffers[view.buffer].uri)
        check(len(blob) >= gltf.buffers[view.buffer].byteLength, "the buffer is short")
        kind = {5126: "<f4", 5125: "<u4"}[accessor.componentType]
        width = {"VEC3": 3, "SCALAR": 1}[accessor.type]
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        array = np.frombuffer(blob, kind, accessor.count * width, start).reshape(-1, width)
        if accessor.min:
            check(np.array_equal(array.min(axis=0), np.float32(accessor.min)), "min")
            check(np.array_equal(array.max(axis=0), np.float32(accessor.max)), "max")
        return array

    (node,) = gltf.nodes
    primitives = gltf.meshes[node.mesh].primitives
    (positions,) = {primitive.attributes.POSITION for primitive in primitives}
    vertices = data(positions).astype(float) + np.asarray(node.translation)
    lines = [data(p.indices).reshape(-1, 2) for p in primitives if p.mode == 1]
    points = [data(p.indices).ravel().tolist() for p in primitives if p.mode == 0]
    same_graph(Wireframe(vertices, np.concatenate(lines) if lines else []), expected)
    check(sum(points, []) == expected.isolated(), "isolated junctions")
    triangles = [data(p.indices).reshape(-1, 3) for p in primitives if p.mode == 4]
    check_mesh(vertices, np.concatenate(triangles) if triangles else [], bare)

    # A second reader, that applies the translation itself, in 32 bits. (trimesh takes
    # the vertices of GL_LINES in their order and ignores the indices.)
    reader = vtk.vtkGLTFReader()
    reader.SetFileName(str(path))
    reader.Update()
    blocks = reader.GetOutput().NewIterator()
    edges = []
    while not blocks.IsDoneWithTraversal():
        found = vtk_wireframe(blocks.GetCurrentDataObject())
        rounding = 1.2e-7 * float(np.abs(expected.vertices).max())
        check_close(found.vertices[:len(expected.vertices)], expected.vertices,
                    expected.extent() + rounding / TOLERANCE, "vertices in VTK")
        edges += found.edges.tolist()
        blocks.GoToNextItem()
    same_graph(Wireframe(expected.vertices, edges), expected)
    return "pygltflib and VTK"


def read_dxf(path, expected):
    import ezdxf

    dxf = ezdxf.readfile(path)
    auditor = dxf.audit()
    check(not auditor.errors and not auditor.fixes,
          f"ezdxf finds {auditor.errors} and fixes {auditor.fixes}")
    space = dxf.modelspace()
    layers = {layer.dxf.name for layer in dxf.layers}
    check({"JUNCTIONS", "ARCS", "SPLINES", "CONFIDENCE_HIGH", "CONFIDENCE_MEDIUM", "CONFIDENCE_LOW",
           "CONFIDENCE_UNKNOWN"} <= layers, f"layers {layers}")
    check({entity.dxf.layer for entity in space} <= layers, "an entity on no layer")
    same_lines([[line.dxf.start, line.dxf.end] for line in space.query("LINE")],
               expected, expected.extent())
    arcs = []
    for arc in space.query("ARC CIRCLE"):
        points = None
        if arc.dxftype() == "ARC":
            start, end = arc.dxf.start_angle, arc.dxf.end_angle
            middle = start + 0.5 * ((end - start) % 360.0)
            points = [list(point) for point in arc.vertices([start, middle, end])]
        center = list(arc.ocs().to_wcs(arc.dxf.center))
        arcs.append((points, (center, list(arc.dxf.extrusion), arc.dxf.radius)))
    same_arcs(arcs, expected)
    for spline, polyline in zip(expected.splines, space.query("POLYLINE"), strict=True):
        check(polyline.is_3d_polyline and polyline.is_closed == spline.is_closed, "flags")
        check_close(np.array([list(point) for point in polyline.points()]), spline.chain(),
                    expected.extent(), "points of a spline")
    points = [point.dxf.location for point in space.query("POINT")]
    same_graph(Wireframe([list(point) for point in points], expected.edges), expected)
    return "ezdxf, audit clean"


def check_shells(shape, parts, expected):
    """Closed shells are valid solids, the others valid sheets, and all volumes together agree."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.TopAbs import TopAbs_ShapeEnum

    solids = list(parts(shape, TopAbs_ShapeEnum.TopAbs_SOLID))
    shells = list(parts(shape, TopAbs_ShapeEnum.TopAbs_SHELL))
    closed = sum(shell["closed"] for shell in expected.shells)
    check(len(solids) == closed, f"{len(solids)} solids, not {closed}")
    check(len(shells) == len(expected.shells), f"{len(shells)} shells")
    check(sum(map(BRep_Tool.IsClosed_s, shells)) == closed, "an open solid, or a closed sheet")
    faces = len(list(parts(shape, TopAbs_ShapeEnum.TopAbs_FACE)))
    check(faces == sum(len(shell["faces"]) for shell in expected.shells), f"{faces} faces")
    for part in shells + solids:
        check(BRepCheck_Analyzer(part).IsValid(), "Open CASCADE finds a shell not valid")
    total = 0.0
    for solid in solids:
        properties = GProp_GProps()
        BRepGProp.VolumeProperties_s(solid, properties)
        total += properties.Mass()
    check_volume(total, expected, "solids")


def read_step(path, expected):
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.GeomAbs import GeomAbs_CurveType
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    reader = STEPControl_Reader()
    check(reader.ReadFile(str(path)) == IFSelect_ReturnStatus.IFSelect_RetDone, "not read")
    reader.TransferRoots()
    shape = reader.OneShape()

    def parts(shape, kind, outside=TopAbs_ShapeEnum.TopAbs_SHAPE):
        explorer = TopExp_Explorer(shape, kind, outside)
        while explorer.More():
            yield explorer.Current()
            explorer.Next()

    if expected.shells:
        check_shells(shape, parts, expected)
    expected = expected.without_faces()
    lengths = [np.linalg.norm(np.subtract(*expected.vertices[edge])) for edge in expected.edges]
    flat = [i for i, length in enumerate(lengths) if length == 0.0]
    expected = expected.without(edges=flat)
    expected = expected.without(vertices=expected.isolated())
    if len(expected.edges) + len(expected.arcs) + len(expected.splines) == 0:
        return "Open CASCADE"

    vertex_kind, edge_kind = TopAbs_ShapeEnum.TopAbs_VERTEX, TopAbs_ShapeEnum.TopAbs_EDGE
    as_vertex = getattr(TopoDS, "Vertex_s", None) or TopoDS.Vertex
    vertices = []
    buckets = {}

    def index(vertex):
        """One index per topological vertex: shared ones are the same."""
        candidates = buckets.setdefault(hash(vertex), [])
        for known, number in candidates:
            if known.IsSame(vertex):
                return number
        point = BRep_Tool.Pnt_s(as_vertex(vertex))
        vertices.append([point.X(), point.Y(), point.Z()])
        candidates.append((vertex, len(vertices) - 1))
        return len(vertices) - 1

    as_edge = getattr(TopoDS, "Edge_s", None) or TopoDS.Edge
    edges, arcs, splines = [], [], []
    for edge in parts(shape, edge_kind, TopAbs_ShapeEnum.TopAbs_FACE):
        curve = BRepAdaptor_Curve(as_edge(edge))
        if curve.GetType() == GeomAbs_CurveType.GeomAbs_Line:
            edges.append([index(vertex) for vertex in parts(edge, vertex_kind)])
            continue
        first, last = curve.FirstParameter(), curve.LastParameter()
        if curve.GetType() == GeomAbs_CurveType.GeomAbs_BSplineCurve:
            check(BRepCheck_Analyzer(edge).IsValid(), "Open CASCADE finds a spline not valid")
            ends = list(parts(edge, vertex_kind))
            splines.append(([curve.Value(x) for x in np.linspace(first, last, 101)],
                            ends[0].IsSame(ends[-1])))
            continue
        points = [curve.Value(first + share * (last - first)) for share in (0.0, 0.5, 1.0)]
        axis = curve.Circle().Axis()
        center, normal = axis.Location(), axis.Direction()
        arcs.append(([[p.X(), p.Y(), p.Z()] for p in points],
                     ([center.X(), center.Y(), center.Z()], [normal.X(), normal.Y(), normal.Z()],
                      curve.Circle().Radius())))
    same_arcs(arcs, expected)
    same_splines([[[p.X(), p.Y(), p.Z()] for p in points] for points, _ in splines], expected)
    check([closed for _, closed in splines] == [spline.is_closed for spline in expected.splines],
          "splines that run around have one vertex, others two")
    found = Wireframe(vertices, edges)
    check(len(vertices) == len(expected.vertices),
          f"{len(vertices)} vertices, not {len(expected.vertices)}")
    # Edges come in their order, each from one end to the other.
    check(len(found.edges) == len(expected.edges), "number of edges")
    ends, truth = found.vertices[found.edges], expected.vertices[expected.edges]
    turned = np.abs(ends - truth).max(axis=(1, 2)) > np.abs(ends[:, ::-1] - truth).max(axis=(1, 2))
    ends[turned] = ends[turned, ::-1]
    same_lines(ends, expected, expected.extent())
    return "Open CASCADE"


def read_svg(path, expected):
    from svgelements import Path as SvgPath

    root = ElementTree.parse(path).getroot()
    space = "{http://www.w3.org/2000/svg}"
    check(root.tag == space + "svg", "the root is no svg")
    numbers = {name: np.array([float(x) for x in root.attrib["data-" + name].split()])
               for name in ("right", "up", "scale", "center")}
    width, height = float(root.attrib["width"]), float(root.attrib["height"])
    axes = np.stack([numbers["right"], numbers["up"]])

    def in_units(x, y):
        offset = np.array([x - width / 2, height / 2 - y]) / numbers["scale"]
        return numbers["center"] + offset

    circles = [in_units(float(c.attrib["cx"]), float(c.attrib["cy"]))
               for c in root.iter(space + "circle")]
    projected = expected.vertices @ axes.T
    check_close(np.reshape(circles, (-1, 2)), projected, expected.extent(), "circles")
    lines = sorted(root.iter(space + "line"), key=lambda line: int(line.attrib["data-edge"]))
    ends = [[in_units(float(l.attrib["x1"]), float(l.attrib["y1"])),
             in_units(float(l.attrib["x2"]), float(l.attrib["y2"]))] for l in lines]
    check_close(np.reshape(ends, (-1, 2, 2)), projected[expected.edges],
                expected.extent(), "lines")

    # Ends and the middle of each elliptical piece lie on the arc as one looks at it; pieces that
    # are thinner than a hundredth of a pixel are straight.
    paths = [path for path in root.iter(space + "path") if "data-arc" in path.attrib]
    check(len(paths) == len(expected.arcs), "number of arcs")
    for arc, element in zip(expected.arcs, paths):
        segments = [s for s in SvgPath(element.attrib["d"]) if type(s).__name__ in ("Arc", "Line")]
        points = [in_units(*segment.point(t)) for segment in segments for t in (0.0, 0.5, 1.0)]
        truth = arc.points([0.0, 1.0]) @ axes.T
        check_close(np.stack([points[0], points[-1]]), truth, expected.extent(), "ends of an arc")
        dense = arc.points(np.linspace(0.0, 1.0, 20001)) @ axes.T
        for point in points:
            off = np.linalg.norm(dense - point, axis=-1).min()
            check(off < 0.02 / numbers["scale"][0] + 1e-4 * arc.radius,
                  f"arc {element.attrib['data-arc']} passes {off} beside itself")
    paths = [path for path in root.iter(space + "path") if "data-spline" in path.attrib]
    for spline, element in zip(expected.splines, paths, strict=True):
        pieces = [s for s in SvgPath(element.attrib["d"]) if type(s).__name__ == "CubicBezier"]
        check(len(pieces) == spline.pieces, "number of cubic pieces")
        shares = np.linspace(0.0, 1.0, 11)
        points = [in_units(*piece.point(share)) for piece in pieces for share in shares]
        places = [piece + share for piece in range(spline.pieces) for share in shares]
        check_close(np.stack(points), spline.points(places) @ axes.T, expected.extent(), "a spline")
    return "ElementTree and svgelements"


def read_png(path, expected):
    from PIL import Image

    image = np.asarray(Image.open(path).convert("L"), dtype=float)
    svg = ElementTree.parse(path.with_suffix(".svg")).getroot()
    check(image.shape == (int(svg.attrib["height"]), int(svg.attrib["width"])), "size")
    # Ink where the vector graphics have lines, and white elsewhere.
    space = "{http://www.w3.org/2000/svg}"
    for line in svg.iter(space + "line"):
        x1, y1, x2, y2 = (float(line.attrib[name]) for name in ("x1", "y1", "x2", "y2"))
        column, row = int((x1 + x2) / 2), int((y1 + y2) / 2)
        check(image[row, column] < 200, f"no line at {column}, {row}")
    circles = len(list(svg.iter(space + "circle")))
    check((image < 60).any() == (circles > 0), "junctions")
    check((image[[0, 0, -1, -1], [0, -1, 0, -1]] == 255).all(), "the corners are not white")
    return "Pillow"


def read_geojson(path, expected):
    collection = json.loads(path.read_text())
    check(collection["type"] == "FeatureCollection", "type")
    features = collection["features"]
    drawn = [f for f in features if f["geometry"]["type"] == "LineString"]
    lines = [f for f in drawn if "edge" in f["properties"]]
    splines = [f for f in drawn if "spline" in f["properties"]]
    arcs = [f for f in drawn if "arc" in f["properties"]]
    for arc, feature in zip(expected.arcs, arcs, strict=True):
        found = np.asarray(feature["geometry"]["coordinates"])
        chain = arc.chain()
        if arc.is_closed:
            chain = np.concatenate([chain, chain[:1]])
        check_close(found, chain, expected.extent(), "points of an arc")
        check(feature["properties"]["radius"] == arc.radius, "radius")
    for spline, feature in zip(expected.splines, splines, strict=True):
        chain = spline.chain()
        if spline.is_closed:
            chain = np.concatenate([chain, chain[:1]])
        check_close(np.asarray(feature["geometry"]["coordinates"]), chain, expected.extent(),
                    "points of a spline")
        check(feature["properties"]["controls"] == spline.controls.tolist(), "control points")
    check(len(lines) + len(arcs) + len(splines) == len(drawn), "other lines")
    points = [f for f in features if f["geometry"]["type"] == "Point"]
    check(len(drawn) + len(points) == len(features), "other features")
    same_lines([line["geometry"]["coordinates"] for line in lines],
               expected, expected.extent())
    check([line["properties"]["junctions"] for line in lines] == expected.edges.tolist(),
          "the properties name other junctions")
    isolated = expected.isolated()
    check([p["properties"]["junction"] for p in points] == isolated, "isolated junctions")
    check_close(np.reshape([p["geometry"]["coordinates"] for p in points], (-1, 3)),
                expected.vertices[isolated], expected.extent(), "points")
    return "json"


def read_cityjson(path, expected):
    import trimesh
    from cjio.cityjson import CityJSON

    with open(path) as file:
        city = CityJSON(file=file)
    check(city.j["version"] == "2.0" and city.is_transform(), "another version")
    check(set(city.j["CityObjects"]) == {f"building-{i + 1}" for i in range(
        sum(shell["closed"] for shell in expected.shells)
        + any(not shell["closed"] for shell in expected.shells))}, "buildings")
    faces = [face for shell in expected.shells for face in shell["faces"]]
    counts = [surface_counts(building) for building in city.j["CityObjects"].values()]
    if expected.name == "house":
        check(counts[0] == {"GroundSurface": 1, "WallSurface": 6, "RoofSurface": 2,
                            "OuterFloorSurface": 1, "OuterCeilingSurface": 1}, f"{counts[0]}")
    city.triangulate(sloppy=True)
    city.decompress()
    vertices = np.asarray(city.j["vertices"], dtype=float).reshape(-1, 3)
    solids = 0.0
    for building in city.j["CityObjects"].values():
        (geometry,) = building["geometry"]
        is_solid = geometry["type"] == "Solid"
        boundaries, values = geometry["boundaries"], geometry["semantics"]["values"]
        if is_solid:
            (boundaries,), (values,) = boundaries, values
        triangles = np.asarray(boundaries).reshape(-1, 3)
        corners = vertices[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        rises = normals[:, 2] / np.linalg.norm(normals, axis=-1)
        for points, rise, value in zip(corners, rises, values, strict=True):
            surface = geometry["semantics"]["surfaces"][value]
            face = faces[surface["face"]]
            if "plane" in face:
                off = points @ face["plane"]["normal"] - face["plane"]["offset"]
                check(np.abs(off).max() < 1e-4 * expected.extent(), "a vertex beside its plane")
            kind = surface["type"]
            agrees = {"WallSurface": abs(rise) < 0.18, "RoofSurface": rise > 0.17,
                      "OuterFloorSurface": rise > 0.17, "GroundSurface": rise < -0.17,
                      "OuterCeilingSurface": rise < -0.17}[kind]
            check(agrees, f"a {kind} whose normal rises by {rise}")
        if is_solid:
            mesh = trimesh.Trimesh(vertices, triangles, process=False)
            check(mesh.is_watertight and mesh.is_winding_consistent, "a solid has holes")
            solids += mesh.volume
    check_volume(solids, expected, "solids")
    return f"cjio and trimesh, {counts}"


def surface_counts(building):
    """How many surfaces of each kind a building has, before it is cut into triangles."""
    semantics = building["geometry"][0]["semantics"]
    values = np.ravel(semantics["values"]).tolist()
    return dict(Counter(semantics["surfaces"][value]["type"] for value in values))


def read_npz(path, expected):
    arrays = np.load(path)
    # As the published evaluation reads it.
    same_lines(arrays["lines3d"], expected, expected.extent())
    check(arrays["lines3d"].shape == (len(expected.edges), 2, 3), "shape of lines3d")
    same_graph(Wireframe(arrays["junctions"], arrays["edges"]), expected)
    check(np.array_equal(arrays["junctions"][arrays["edges"]], arrays["lines3d"]),
          "edges do not lead to lines3d")
    arcs = [Arc(*numbers) for numbers in zip(arrays["arc_centers"], arrays["arc_axes"],
                                             arrays["arc_radii"], arrays["arc_angles"])]
    same_arcs([(arc.points([0.0, 0.5, 1.0]), (arc.center, np.cross(*arc.axes), arc.radius))
               for arc in arcs], expected)
    controls = np.split(arrays["spline_controls"], np.cumsum(arrays["spline_sizes"])[:-1])
    for spline, points, closed in zip(expected.splines, controls, arrays["spline_closed"]):
        check(np.array_equal(points, spline.controls) and closed == spline.is_closed, "a spline")
    check(len(arrays["spline_closed"]) == len(expected.splines), "number of splines")
    return "numpy"


def read_colmap(path, expected):
    import pycolmap

    model = pycolmap.Reconstruction(str(path))
    ids = sorted(model.points3D)
    check(ids == list(range(1, len(expected.vertices) + 1)), "point ids")
    rows = [line.split() for line in (path / "lines3D.txt").read_text().splitlines()
            if not line.startswith("#")]
    check([int(row[0]) for row in rows] == list(range(1, len(expected.edges) + 1)), "line ids")
    same_graph(Wireframe([model.points3D[i].xyz for i in ids],
                         [[int(row[1]) - 1, int(row[2]) - 1] for row in rows]), expected)
    return "pycolmap"


def read_mesh(path, expected):
    import trimesh

    mesh = trimesh.load(path, process=False)
    check(mesh.is_watertight and mesh.is_winding_consistent, "the mesh has holes")
    check(mesh.euler_number == 2, "Euler characteristic")
    check(abs(mesh.volume / (4 / 3 * math.pi * 0.75**3) - 1) < 2e-3, "volume")
    return f"trimesh, {len(mesh.vertices)} vertices, {len(mesh.faces)} triangles"


def main(arguments):
    if len(arguments) != 2:
        sys.exit(__doc__)
    truth = json.loads(Path(arguments[0]).read_text())
    directory = Path(arguments[1])
    expected = Wireframe(truth["junctions"], truth.get("edges", truth.get("lines", [])),
                         [Arc(**arc) for arc in truth.get("arcs", [])], truth.get("shells", []),
                         truth.get("metadata", {}).get("scene"),
                         [Spline(**spline) for spline in truth.get("splines", [])],
                         [Dome(**dome) for dome in truth.get("domes", [])])
    readers = [("wireframe.json", read_json), ("wireframe.obj", read_obj),
               ("wireframe.ply", read_ply), ("wireframe.gltf", read_gltf),
               ("wireframe.glb", read_gltf), ("wireframe.dxf", read_dxf),
               ("wireframe.step", read_step), ("wireframe.geojson", read_geojson),
               ("wireframe.city.json", read_cityjson),
               ("wireframe.npz", read_npz), ("colmap", read_colmap)]
    for view in ("front", "top", "side", "isometric"):
        readers += [(f"wireframe-{view}.svg", read_svg), (f"wireframe-{view}.png", read_png)]
    readers.append(("ball.ply", read_mesh))
    failed = 0
    for name, read in readers:
        try:
            print(f"{name}: the same in {read(directory / name, expected)}")
        except Exception as error:  # One bad file must not hide the next.
            failed += 1
            print(f"{name}: FAILED: {type(error).__name__}: {error}")
    print(f"{len(expected.vertices)} vertices, {len(expected.edges)} edges, "
          f"{len(expected.arcs)} arcs, {len(expected.splines)} splines: "
          f"{len(readers) - failed} of {len(readers)} files agree")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
