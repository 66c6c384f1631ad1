"""The true wireframe and a mesh of a solid of OpenCASCADE."""

import dataclasses
import math

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepGProp import BRepGProp, BRepGProp_Face
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GeomAbs import (
    GeomAbs_BSplineCurve,
    GeomAbs_Circle,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Ellipse,
    GeomAbs_Line,
    GeomAbs_Plane,
    GeomAbs_Sphere,
)
from OCP.gp import gp_Pnt, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS
from OCP.TopTools import (
    TopTools_IndexedDataMapOfShapeListOfShape,
    TopTools_IndexedMapOfShape,
)

# Faces that meet at a smaller angle, in degrees, meet smoothly.
SMOOTH = 4.0
# Points of curves are so near each other, where the part has unit size.
SPACING = 0.005
KINDS = {GeomAbs_Circle: "arc", GeomAbs_Ellipse: "ellipse", GeomAbs_BSplineCurve: "bspline"}


@dataclasses.dataclass
class Mesh:
    vertices: np.ndarray
    """Analytic normals of the faces, one a vertex: those of neighbouring faces are apart."""
    normals: np.ndarray
    triangles: np.ndarray


def mesh(shape, deflection):
    """Triangles of all faces, at most `deflection` off."""
    BRepMesh_IncrementalMesh(shape, deflection, False, 0.08, False)
    faces = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_FACE, faces)
    vertices, normals, triangles = [], [], []
    for index in range(1, faces.Extent() + 1):
        face, location = TopoDS.Face_s(faces.FindKey(index)), TopLoc_Location()
        patch = BRep_Tool.Triangulation_s(face, location)
        first = len(vertices)
        for node in range(1, patch.NbNodes() + 1):
            point = patch.Node(node).Transformed(location.Transformation())
            at = patch.UVNode(node)
            vertices.append([point.X(), point.Y(), point.Z()])
            normals.append(normal_at(face, at.X(), at.Y()))
        for triangle in range(1, patch.NbTriangles() + 1):
            a, b, c = patch.Triangle(triangle).Get()
            if face.Orientation() == TopAbs_REVERSED:
                a, b = b, a
            triangles.append([first + a - 1, first + b - 1, first + c - 1])
    normals = np.array(normals)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(np.array(vertices), normals / np.maximum(lengths, 1e-12), np.array(triangles))


def normal_at(face, u, v):
    point, normal = gp_Pnt(), gp_Vec()
    BRepGProp_Face(face).Normal(u, v, point, normal)
    return [normal.X(), normal.Y(), normal.Z()]


def wireframe(shape, place):
    """Sharp edges as `gt_wireframe.json` holds them, with points moved by `place`."""
    edges = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, edges)
    straight, curves = [], []
    for index in range(1, edges.Extent() + 1):
        edge = TopoDS.Edge_s(edges.FindKey(index))
        faces = [TopoDS.Face_s(face) for face in edges.FindFromIndex(index)]
        if BRep_Tool.Degenerated_s(edge) or not is_sharp(edge, faces):
            continue
        curve = BRepAdaptor_Curve(edge)
        if curve.GetType() == GeomAbs_Line:
            straight.append(points_of(curve, 2, place))
            continue
        points = points_of(curve, 200, place)
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        points = points_of(curve, max(8, int(length / SPACING) + 1), place)
        curves.append((KINDS.get(curve.GetType(), "other"), length, points))
    return document(straight, curves)


def faces(shape, place):
    """Faces as `gt_wireframe.json` holds them, without the edges around them."""
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_FACE, found)
    return [
        face_of(TopoDS.Face_s(found.FindKey(index)), place)
        for index in range(1, found.Extent() + 1)
    ]


def face_of(face, place):
    at = lambda point: place(np.array([[point.X(), point.Y(), point.Z()]]))[0]
    way = lambda direction: np.array([direction.X(), direction.Y(), direction.Z()])
    scale = np.linalg.norm(at(gp_Pnt(1, 0, 0)) - at(gp_Pnt(0, 0, 0)))
    measured = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, measured)
    area = measured.Mass() * scale**2
    surface = BRepAdaptor_Surface(face)
    kind = surface.GetType()
    if kind == GeomAbs_Plane:
        normal = way(surface.Plane().Axis().Direction())
        normal *= -1 if face.Orientation() == TopAbs_REVERSED else 1
        offset = float(normal @ at(surface.Plane().Location()))
        return {"type": "plane", "area": area, "normal": normal.tolist(), "offset": offset}
    if kind == GeomAbs_Cylinder:
        cylinder = surface.Cylinder()
        point, axis = at(cylinder.Location()), way(cylinder.Axis().Direction())
        numbers = {"axis_point": point.tolist(), "axis": axis.tolist()}
        return {"type": "cylinder", "area": area, **numbers, "radius": cylinder.Radius() * scale}
    if kind == GeomAbs_Cone:
        cone = surface.Cone()
        angle, axis = cone.SemiAngle(), way(cone.Axis().Direction())
        numbers = {"apex": at(cone.Apex()).tolist(), "axis": (axis * np.sign(angle)).tolist()}
        return {"type": "cone", "area": area, **numbers, "half_angle": abs(angle)}
    if kind == GeomAbs_Sphere:
        sphere = surface.Sphere()
        center, radius = at(sphere.Location()).tolist(), sphere.Radius() * scale
        return {"type": "sphere", "area": area, "center": center, "radius": radius}
    return {"type": "other", "area": area}


def is_sharp(edge, faces):
    """Whether two faces meet at an angle anywhere along an edge."""
    if len(faces) != 2 or faces[0].IsSame(faces[1]):
        return False
    curve = BRepAdaptor_Curve(edge)
    first, last = curve.FirstParameter(), curve.LastParameter()
    for place in np.linspace(0.02, 0.98, 9):
        normals = []
        for face in faces:
            at = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0).Value(
                first + (last - first) * place
            )
            normals.append(np.array(normal_at(face, at.X(), at.Y())))
        lengths = [np.linalg.norm(normal) for normal in normals]
        if min(lengths) > 1e-12:
            cosine = normals[0] @ normals[1] / lengths[0] / lengths[1]
            if cosine < math.cos(math.radians(SMOOTH)):
                return True
    return False


def points_of(curve, count, place):
    parameters = np.linspace(curve.FirstParameter(), curve.LastParameter(), count)
    values = [curve.Value(parameter) for parameter in parameters]
    return place(np.array([[value.X(), value.Y(), value.Z()] for value in values]))


def document(straight, curves):
    junctions = []

    def junction(point):
        for index, other in enumerate(junctions):
            if np.linalg.norm(point - other) < 1e-5:
                return index
        junctions.append(point)
        return len(junctions) - 1

    lines = [[junction(end) for end in line] for line in straight]
    found = []
    for kind, length, points in curves:
        closed = np.linalg.norm(points[0] - points[-1]) < 1e-6
        ends = None if closed else [junction(points[0]), junction(points[-1])]
        kind = "circle" if closed and kind == "arc" else kind
        found.append({"type": kind, "ends": ends, "points": points.tolist(), "length": length})
    of_curves = {end for curve in found for end in curve["ends"] or []}
    lines = joined(lines, junctions, of_curves)
    used = sorted({end for line in lines for end in line} | of_curves)
    new = {old: index for index, old in enumerate(used)}
    for curve in found:
        curve["ends"] = curve["ends"] and [new[end] for end in curve["ends"]]
    return {
        "junctions": [junctions[old].tolist() for old in used],
        "lines": [[new[end] for end in line] for line in lines],
        "curves": found,
    }


def joined(lines, junctions, of_curves):
    """Lines that go on in each other where nothing else ends, as one."""
    while True:
        at = {}
        for line in lines:
            for end in line:
                at.setdefault(end, []).append(line)
        for end, two in at.items():
            if len(two) != 2 or end in of_curves:
                continue
            far = [line[1 - line.index(end)] for line in two]
            before, after = junctions[end] - junctions[far[0]], junctions[far[1]] - junctions[end]
            if before @ after > (1 - 1e-9) * np.linalg.norm(before) * np.linalg.norm(after):
                lines = [line for line in lines if line not in two] + [far]
                break
        else:
            return lines
