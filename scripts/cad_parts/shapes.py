"""Everyday parts, by their features: plates, brackets, shafts, housings.

`FIRST` are those on which the assembler was worked on, `SECOND` were looked at only once it was
done, `ROUND` have parts of spheres, and what looks like such, `THIRD` pockets, sockets, slots and
ribs, `FOURTH` rounded pockets, keyways and chamfered turned parts. Lengths are in mm; a scene scales its part to unit size.
"""

import math

from build123d import *  # noqa: F403, the language of these parts


def bracket():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline((0, 0), (60, 0), (60, 8), (8, 8), (8, 45), (0, 45), close=True)
            make_face()
        extrude(amount=40)
        e = p.edges().filter_by(Axis.Y).sort_by_distance((8, -20, 8))[0]
        fillet(e, 5)
        with Locations((25, -10, 8), (25, -30, 8), (50, -10, 8), (50, -30, 8)):
            Hole(3.5)
        chamfer(p.edges().filter_by(Axis.Z).sort_by(Axis.X)[-2:], 6)
    return p


def flange():
    with BuildPart() as p:
        Cylinder(40, 10)
        with Locations((0, 0, 5)):
            Cylinder(20, 18, align=(Align.CENTER, Align.CENTER, Align.MIN))
        Hole(12)
        with PolarLocations(30, 6):
            Hole(4)
    return p


def nut():
    with BuildPart() as p:
        with BuildSketch():
            RegularPolygon(20, 6)
        extrude(amount=16)
        Hole(10)
    return p


def shaft():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline(
                    (0, 0), (12, 0), (12, 30), (18, 30), (18, 40), (10, 40), (10, 80),
                    (0, 80),
                    close=True,
                )
            make_face()
        revolve(axis=Axis.Z)
        chamfer(p.edges().filter_by(GeomType.CIRCLE).sort_by(Axis.Z)[-1:], 2)
        with Locations((0, 8, 60)):
            Box(5, 6, 24, mode=Mode.SUBTRACT, align=(Align.CENTER, Align.MIN, Align.CENTER))
    return p


def channel():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline(
                    (0, 0), (40, 0), (40, 30), (33, 30), (33, 26), (36, 26), (36, 4),
                    (4, 4), (4, 26), (7, 26), (7, 30), (0, 30),
                    close=True,
                )
            make_face()
        extrude(amount=70)
    return p


def enclosure():
    with BuildPart() as p:
        Box(70, 50, 25)
        offset(amount=-3, openings=p.faces().sort_by(Axis.Z)[-1:])
        with Locations((0, 0, -9.5)):
            Box(3, 44, 12, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((-25, -16, -9.5), (25, 16, -9.5)):
            Cylinder(4, 14, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((35, 0, 2)):
            Box(10, 18, 8, mode=Mode.SUBTRACT)
    return p


def plate():
    with BuildPart() as p:
        with BuildSketch():
            RectangleRounded(80, 50, 8)
            with Locations((-20, 0), (20, 0)):
                SlotOverall(26, 10, rotation=90, mode=Mode.SUBTRACT)
            Circle(6, mode=Mode.SUBTRACT)
        extrude(amount=6)
    return p


def tee():
    with BuildPart() as p:
        Cylinder(10, 60, rotation=(0, 90, 0))
        Cylinder(8, 30, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((0, 0, 26)):
            Box(26, 26, 5, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((0, 0, 40)):
            Hole(5, depth=40)
    return p


def house():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline(
                    (0, 0), (60, 0), (60, 30), (64, 27), (64, 29.5), (30, 55), (-4, 29.5),
                    (-4, 27), (0, 30),
                    close=True,
                )
            make_face()
        extrude(amount=80)
        with Locations((45, -20, 48)):
            Box(8, 8, 24)
        with Locations((30, 0, 0)):
            Box(10, 3, 20, mode=Mode.SUBTRACT, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((12, 0, 14), (48, 0, 14)):
            Box(9, 3, 10, mode=Mode.SUBTRACT)
        with Locations((60, -20, 14), (60, -40, 14), (60, -60, 14)):
            Box(3, 9, 10, mode=Mode.SUBTRACT)
    return p


def heatsink():
    with BuildPart() as p:
        Box(60, 50, 6, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations([(-27+6.75 * i, 0, 6) for i in range(9)]):
            Box(2, 50, 22, align=(Align.CENTER, Align.CENTER, Align.MIN))
    return p


def gear():
    n = 14
    pts = []
    for i in range(n):
        a, w = 2 * math.pi * i / n, 2 * math.pi / n
        for f, r in ((-.28, 30), (-.14, 37), (.14, 37), (.28, 30)):
            pts.append((r * math.cos(a + f * w), r * math.sin(a + f * w)))
    with BuildPart() as p:
        with BuildSketch():
            with BuildLine():
                Polyline(*pts, close=True)
            make_face()
            Circle(9, mode=Mode.SUBTRACT)
            with Locations((0, 9)):
                Rectangle(5, 6, mode=Mode.SUBTRACT)
        extrude(amount=14)
    return p


def pillow():
    with BuildPart() as p:
        Box(80, 26, 10, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with BuildSketch(Plane.XZ):
            with Locations((0, 30)):
                Circle(20)
            with Locations((0, 15)):
                Rectangle(40, 30)
        extrude(amount=11, both=True)
        with BuildSketch(Plane.XZ):
            with Locations((0, 30)):
                Circle(11)
        extrude(amount=30, both=True, mode=Mode.SUBTRACT)
        with Locations((-31, 0, 10), (31, 0, 10)):
            CounterBoreHole(3, 5, 3)
    return p


def dovetail():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline(
                    (0, 0), (50, 0), (50, 20), (37, 20), (42, 9), (8, 9), (13, 20), (0, 20),
                    close=True,
                )
            make_face()
        extrude(amount=45)
        with BuildSketch(Plane.XY.offset(0)):
            with Locations((25, -22)):
                Rectangle(14, 20)
        extrude(amount=9, taper=12, mode=Mode.SUBTRACT)
    return p


def frustum():
    with BuildPart() as p:
        with BuildSketch():
            Rectangle(60, 44)
        extrude(amount=26, taper=20)
        with Locations((0, 0, 26)):
            Box(16, 10, 12, mode=Mode.SUBTRACT, rotation=(0, 0, 25))
    return p


def cube():
    with BuildPart() as p:
        Box(40, 40, 40)
        chamfer(p.edges().filter_by(Axis.Z), 5)
        with Locations(p.faces().sort_by(Axis.Z)[-1]):
            CounterSinkHole(5, 10)
        with Locations(p.faces().sort_by(Axis.X)[-1]):
            Hole(6, depth=15)
    return p


def beam():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline(
                    (0, 0), (30, 0), (30, 4), (17, 4), (17, 36), (30, 36), (30, 40),
                    (0, 40), (0, 36), (13, 36), (13, 4), (0, 4),
                    close=True,
                )
            make_face()
        extrude(amount=90)
        split(bisect_by=Plane(origin=(15, -10, 20), z_dir=(.5, -1, .35)), keep=Keep.TOP)
    return p


def clamp():
    with BuildPart() as p:
        with BuildSketch():
            Circle(24)
            with Locations((30, 0)):
                Rectangle(28, 16)
            Circle(16, mode=Mode.SUBTRACT)
            with Locations((30, 0)):
                Rectangle(36, 4, mode=Mode.SUBTRACT)
        extrude(amount=18)
        with BuildSketch(Plane.XZ):
            with Locations((36, 9)):
                Circle(3.5)
        extrude(amount=30, both=True, mode=Mode.SUBTRACT)
    return p


def cam():
    with BuildPart() as p:
        with BuildSketch():
            with BuildLine():
                Spline((0, -20), (22, -8), (30, 15), (8, 30), (-18, 18), (-20, -6), periodic=True)
            make_face()
            Circle(7, mode=Mode.SUBTRACT)
        extrude(amount=12)
        with Locations((0, 0, 12)):
            Cylinder(11, 8, align=(Align.CENTER, Align.CENTER, Align.MIN))
        Hole(7)
    return p


def stairs():
    with BuildPart() as p:
        for i in range(6):
            with Locations((0, i * 8, 0)):
                Box(30, 8, 5 * (i + 1), align=(Align.CENTER, Align.MIN, Align.MIN))
        with Locations((17, 0, 0)):
            Box(4, 48, 36, align=(Align.CENTER, Align.MIN, Align.MIN))
    return p


def vase():
    with BuildPart() as p:
        with BuildSketch():
            RegularPolygon(18, 8)
        with BuildSketch(Plane.XY.offset(50)):
            RegularPolygon(28, 8)
        loft()
        with BuildSketch(Plane.XY.offset(6)):
            RegularPolygon(13, 8)
        with BuildSketch(Plane.XY.offset(50)):
            RegularPolygon(24, 8)
        loft(mode=Mode.SUBTRACT)
    return p


def casting():
    with BuildPart() as p:
        Box(60, 40, 14)
        with Locations((0, 0, 7)):
            Cylinder(14, 20, align=(Align.CENTER, Align.CENTER, Align.MIN))
        fillet(p.edges().filter_by(Axis.Z).filter_by(GeomType.LINE), 6)
        fillet(p.edges().filter_by(GeomType.CIRCLE).sort_by_distance((0, 14, 7))[0], 3)
        fillet(p.faces().sort_by_distance((25, 0, 7))[0].outer_wire().edges(), 2)
        Hole(8)
    return p


def knob():
    with BuildPart() as p:
        with BuildSketch():
            Circle(20)
            with PolarLocations(22, 8):
                Circle(5, mode=Mode.SUBTRACT)
        extrude(amount=14)
        with Locations((0, 0, 14)):
            Cylinder(10, 12, align=(Align.CENTER, Align.CENTER, Align.MIN))
        Hole(4)
    return p


def hinge():
    with BuildPart() as p:
        Box(50, 36, 4, align=(Align.MIN, Align.CENTER, Align.MIN))
        with Locations((0, -12, 4)):
            Cylinder(5, 12, rotation=(90, 0, 0))
        with Locations((0, 12, 4)):
            Cylinder(5, 12, rotation=(90, 0, 0))
        with Locations((0, 0, 4)):
            Cylinder(2.5, 60, rotation=(90, 0, 0), mode=Mode.SUBTRACT)
        with Locations((20, -10, 4), (20, 10, 4), (38, 0, 4)):
            CounterSinkHole(2, 4)
    return p


def tray():
    with BuildPart() as p:
        with BuildSketch():
            RectangleRounded(70, 46, 6)
        extrude(amount=16)
        offset(amount=-2.5, openings=p.faces().sort_by(Axis.Z)[-1:])
        with Locations((0, 0, 2)):
            Box(2, 41, 10, align=(Align.CENTER, Align.CENTER, Align.MIN))
    return p


def keyblock():
    with BuildPart() as p:
        Box(60, 30, 20)
        with Locations((0, 0, 10)):
            Box(20, 30, 12, mode=Mode.SUBTRACT)
        with Locations((-20, 0, 10), (20, 0, 10)):
            Hole(4, depth=12)
        chamfer(p.edges().filter_by(Axis.Y).group_by(Axis.Z)[0], 3)
    return p


def pulley():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline(
                    (5, 0), (30, 0), (30, 4), (22, 8), (22, 10), (30, 14), (30, 18),
                    (5, 18),
                    close=True,
                )
            make_face()
        revolve(axis=Axis.Z)
        with PolarLocations(13, 5):
            Hole(3.5)
    return p


def arrow():
    with BuildPart() as p:
        with BuildSketch():
            with BuildLine():
                Polyline(
                    (0, 8), (40, 8), (40, 18), (64, 0), (40, -18), (40, -8), (0, -8),
                    close=True,
                )
            make_face()
        extrude(amount=10)
        fillet(p.edges().filter_by(Axis.Z).group_by(Axis.X)[0], 6)
    return p


def bridge():
    with BuildPart() as p:
        Box(80, 20, 30, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with BuildSketch(Plane.XZ):
            with Locations((0, 0)):
                Circle(16)
            with Locations((-28, 0)):
                Circle(8)
            with Locations((28, 0)):
                Circle(8)
        extrude(amount=30, both=True, mode=Mode.SUBTRACT)
        with Locations((0, 0, 30)):
            Box(80, 26, 4, align=(Align.CENTER, Align.CENTER, Align.MIN))
    return p


def vblock():
    with BuildPart() as p:
        Box(50, 40, 36, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline((-18, 36), (0, 18), (18, 36), close=True)
            make_face()
        extrude(amount=40, both=True, mode=Mode.SUBTRACT)
        with Locations((0, 0, 18)):
            Box(4, 40, 8, mode=Mode.SUBTRACT)
        with Locations((-25, 0, 14), (25, 0, 14)):
            Box(12, 40, 6, mode=Mode.SUBTRACT)
    return p


def elbow():
    with BuildPart() as p:
        with BuildLine() as path:
            Polyline((0, 0, 0), (0, 0, 30))
            RadiusArc((0, 0, 30), (20, 0, 50), -20)
            Line((20, 0, 50), (40, 0, 50))
        with BuildSketch(Plane.XY):
            Rectangle(14, 14)
        sweep(path=path.wire())
    return p


def castle():
    with BuildPart() as p:
        Box(40, 40, 30, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((0, 0, 30)):
            Box(8, 40, 8, align=(Align.CENTER, Align.CENTER, Align.MAX), mode=Mode.SUBTRACT)
            Box(40, 8, 8, align=(Align.CENTER, Align.CENTER, Align.MAX), mode=Mode.SUBTRACT)
        with Locations((0, 0, 30)):
            Box(30, 30, 12, align=(Align.CENTER, Align.CENTER, Align.MAX), mode=Mode.SUBTRACT)
        with Locations((0, 20, 0)):
            Box(10, 10, 18, align=(Align.CENTER, Align.CENTER, Align.MIN), mode=Mode.SUBTRACT)
    return p


def prismhole():
    with BuildPart() as p:
        with BuildSketch():
            RegularPolygon(26, 5)
        extrude(amount=24)
        with BuildSketch(Plane.XY.offset(24)):
            RegularPolygon(12, 3, rotation=17)
        extrude(amount=-15, mode=Mode.SUBTRACT)
        chamfer(p.edges().group_by(Axis.Z)[0], 3)
    return p


def lever():
    with BuildPart() as p:
        with BuildSketch():
            SlotCenterToCenter(50, 20)
        extrude(amount=8)
        with Locations((-25, 0, 8)):
            Cylinder(8, 10, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((-25, 0, 0), (25, 0, 0)):
            Hole(5)
        with BuildSketch(Plane.XY.offset(8)):
            SlotCenterToCenter(18, 8)
        extrude(amount=-3, mode=Mode.SUBTRACT)
    return p


def dowel():
    with BuildPart() as p:
        Cylinder(10, 40)
        with Locations((0, 0, 20)):
            Sphere(10)
    return p


def ballknob():
    with BuildPart() as p:
        Cylinder(17, 6)
        Cylinder(6, 30, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((0, 0, 33)):
            Sphere(13)
    return p


def rivet():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Line((0, 0), (16, 0))
                RadiusArc((16, 0), (0, 8), -20)
                Line((0, 8), (0, 0))
            make_face()
        revolve(axis=Axis.Z)
        Cylinder(7, 25, align=(Align.CENTER, Align.CENTER, Align.MAX))
    return p


def observatory():
    with BuildPart() as p:
        Box(70, 60, 15, align=(Align.CENTER, Align.CENTER, Align.MAX))
        Cylinder(22, 12, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((0, 0, 12)):
            Sphere(22, arc_size1=0)
        with Locations((28, 23, 0), (-28, 23, 0), (28, -23, 0), (-28, -23, 0)):
            Hole(3)
    return p


def acornnut():
    with BuildPart() as p:
        with BuildSketch():
            RegularPolygon(18, 6)
        extrude(amount=14)
        with Locations((0, 0, 14)):
            Cylinder(13, 4, align=(Align.CENTER, Align.CENTER, Align.MIN))
        with Locations((0, 0, 18)):
            Sphere(13, arc_size1=0)
        with Locations((0, 0, 12)):
            Cylinder(8, 12, align=(Align.CENTER, Align.CENTER, Align.MAX), mode=Mode.SUBTRACT)
    return p


def dimple():
    with BuildPart() as p:
        Box(50, 40, 18, align=(Align.CENTER, Align.CENTER, Align.MAX))
        with Locations((-8, 0, 6)):
            Sphere(16, mode=Mode.SUBTRACT)
    return p


def roundedge():
    with BuildPart() as p:
        Cylinder(20, 30)
        fillet(p.edges().filter_by(GeomType.CIRCLE).sort_by(Axis.Z)[-1:], 12)
    return p


def bullet():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline((0, 40), (0, 0), (12, 0), (12, 15))
                Spline((12, 15), (9, 30), (0, 40), tangents=((0, 1), (-1, 0.6)))
            make_face()
        revolve(axis=Axis.Z)
    return p


def pocket():
    with BuildPart() as p:
        Box(80, 50, 20)
        fillet(p.edges().filter_by(Axis.Z), 8)
        with BuildSketch(p.faces().sort_by(Axis.Z)[-1]):
            RectangleRounded(64, 34, 6)
        extrude(amount=-12, mode=Mode.SUBTRACT)
        with BuildSketch(Plane.XY.offset(-2)):
            RectangleRounded(20, 12, 3)
        extrude(amount=6)
    return p


def slider():
    with BuildPart() as p:
        Box(90, 40, 10)
        with BuildSketch(p.faces().sort_by(Axis.Z)[-1]):
            with Locations((0, 8), (0, -8)):
                SlotOverall(60, 8)
        extrude(amount=-10, mode=Mode.SUBTRACT)
        with Locations((38, 12, 5), (38, -12, 5), (-38, 12, 5), (-38, -12, 5)):
            CounterBoreHole(2, 3.5, 3)
    return p


def sockethead():
    with BuildPart() as p:
        Cylinder(18, 20, align=(Align.CENTER, Align.CENTER, Align.MIN))
        Cylinder(10, 50, align=(Align.CENTER, Align.CENTER, Align.MAX))
        chamfer(p.edges().filter_by(GeomType.CIRCLE).sort_by(Axis.Z)[:1], 2)
        with BuildSketch(p.faces().sort_by(Axis.Z)[-1]):
            RegularPolygon(10, 6)
        extrude(amount=-9, mode=Mode.SUBTRACT)
    return p


def gusset():
    with BuildPart() as p:
        Box(60, 50, 6, align=(Align.CENTER, Align.CENTER, Align.MAX))
        with Locations((-27, 0, 0)):
            Box(6, 50, 50, align=(Align.CENTER, Align.CENTER, Align.MIN))
        for y in (-15, 15):
            with BuildSketch(Plane.XZ.offset(-y)):
                with BuildLine():
                    Polyline((-24, 0), (20, 0), (-24, 38), close=True)
                make_face()
            extrude(amount=2.5, both=True)
    return p


def tslot():
    with BuildPart() as p:
        with BuildSketch():
            Rectangle(40, 40)
            for turn in range(4):
                with Locations(Rot(0, 0, 90 * turn) * Pos(0, 18)):
                    Rectangle(8, 4, mode=Mode.SUBTRACT)
                with Locations(Rot(0, 0, 90 * turn) * Pos(0, 13)):
                    Rectangle(18, 6, mode=Mode.SUBTRACT)
            Circle(4, mode=Mode.SUBTRACT)
        extrude(amount=50)
    return p


def steps():
    with BuildPart() as p:
        for k, radius in enumerate((30, 24, 18, 12)):
            with Locations((0, 0, 10 * k)):
                Cylinder(radius, 10, align=(Align.CENTER, Align.CENTER, Align.MIN))
        Hole(6)
        with Locations((0, 0, 20)):
            Box(80, 6, 20, mode=Mode.SUBTRACT, align=(Align.CENTER, Align.CENTER, Align.MIN))
    return p


def yoke():
    with BuildPart() as p:
        Box(30, 50, 12, align=(Align.CENTER, Align.CENTER, Align.MAX))
        for y in (-20, 20):
            with BuildSketch(Plane.XZ.offset(-y)):
                with BuildLine():
                    Polyline((15, 0), (15, 20))
                    RadiusArc((15, 20), (-15, 20), -15)
                    Polyline((-15, 20), (-15, 0), (15, 0))
                make_face()
                with Locations((0, 20)):
                    Circle(7, mode=Mode.SUBTRACT)
            extrude(amount=5, both=True)
        with Locations((0, 0, -12)):
            Cylinder(9, 20, align=(Align.CENTER, Align.CENTER, Align.MAX))
    return p


def letter():
    with BuildPart() as p:
        with BuildSketch():
            with BuildLine():
                Polyline(
                    (0, 0), (12, 0), (12, 22), (30, 0), (45, 0), (22, 27), (43, 55), (28, 55),
                    (12, 33), (12, 55), (0, 55),
                    close=True,
                )
            make_face()
        extrude(amount=14)
    return p


def wedge():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline((0, 0), (80, 0), (80, 8), (10, 35), (0, 35), close=True)
            make_face()
        extrude(amount=40)
        slope = p.faces().sort_by(lambda face: face.normal_at().dot(Vector(0.36, 0, 0.93)))[-1]
        with BuildSketch(slope):
            with Locations((12, 0), (-14, 0)):
                Circle(8)
        extrude(amount=-12, mode=Mode.SUBTRACT)
    return p


def ribs():
    with BuildPart() as p:
        Box(90, 60, 5, align=(Align.CENTER, Align.CENTER, Align.MAX))
        with BuildSketch():
            with GridLocations(0, 18, 1, 3):
                Rectangle(80, 3)
            with GridLocations(26, 0, 3, 1):
                Rectangle(3, 50)
        extrude(amount=12)
    return p


def cover():
    with BuildPart() as p:
        with BuildSketch():
            RegularPolygon(30, 8)
        extrude(amount=14)
        top = p.faces().sort_by(Axis.Z)[-1]
        chamfer(top.edges(), 4)
        offset(amount=-3, openings=p.faces().sort_by(Axis.Z)[:1])
    return p


def block():
    with BuildPart() as p:
        Box(60, 40, 40)
        fillet(p.edges().filter_by(Axis.X).sort_by(Axis.Z)[-2:], 10)
        with Locations(Plane.YZ.offset(30)):
            with Locations((0, 0)):
                Cylinder(9, 120, mode=Mode.SUBTRACT)
        with Locations((0, 0, 20)):
            Cylinder(6, 40, mode=Mode.SUBTRACT)
    return p


def bushing():
    with BuildPart() as p:
        Cylinder(16, 6, align=(Align.CENTER, Align.CENTER, Align.MIN))
        Cylinder(11, 34, align=(Align.CENTER, Align.CENTER, Align.MIN))
        chamfer(p.edges().filter_by(GeomType.CIRCLE).sort_by(Axis.Z)[-1:], 2.5)
        Hole(6)
        with Locations((0, 0, 24)):
            Box(5, 40, 20, mode=Mode.SUBTRACT, align=(Align.CENTER, Align.CENTER, Align.MIN))
    return p


def sunk():
    with BuildPart() as p:
        Box(70, 44, 9)
        fillet(p.edges().filter_by(Axis.Z), 7)
        with Locations((0, 0, 4.5)):
            with GridLocations(48, 24, 2, 2):
                CounterSinkHole(2.5, 5.5)
    return p


def keyshaft():
    with BuildPart() as p:
        Cylinder(9, 70)
        chamfer(p.edges().filter_by(GeomType.CIRCLE), 1.5)
        with BuildSketch(Plane.XZ.offset(-9)):
            with Locations((0, 8)):
                SlotOverall(26, 6, rotation=90)
        extrude(amount=4, mode=Mode.SUBTRACT)
    return p


def case():
    with BuildPart() as p:
        Box(64, 42, 18)
        fillet(p.edges().filter_by(Axis.Z), 9)
        with BuildSketch(p.faces().sort_by(Axis.Z)[-1]):
            RectangleRounded(58, 36, 6)
        extrude(amount=-15, mode=Mode.SUBTRACT)
        with Locations((32, 0, 3)):
            Box(10, 12, 6, mode=Mode.SUBTRACT)
    return p


def link():
    with BuildPart() as p:
        with BuildSketch():
            SlotOverall(80, 24)
            with Locations((-28, 0), (28, 0)):
                Circle(6, mode=Mode.SUBTRACT)
            RectangleRounded(30, 12, 4, mode=Mode.SUBTRACT)
        extrude(amount=7)
    return p


def collar():
    with BuildPart() as p:
        Cylinder(20, 16)
        Hole(11)
        with Locations((15, 0, 0)):
            Box(14, 3, 20, mode=Mode.SUBTRACT)
        with Locations((-24, 0, 0)):
            Box(12, 40, 20, mode=Mode.SUBTRACT)
    return p


def drawer():
    with BuildPart() as p:
        Box(76, 48, 22)
        with BuildSketch(p.faces().sort_by(Axis.Z)[-1]):
            with Locations((-19, 0), (17, 0)):
                RectangleRounded(32, 40, 5)
        extrude(amount=-18, mode=Mode.SUBTRACT)
        with Locations((0, -24, 11)):
            Box(20, 6, 8, mode=Mode.SUBTRACT)
    return p


def spindle():
    with BuildPart() as p:
        with BuildSketch(Plane.XZ):
            with BuildLine():
                Polyline(
                    (0, 0), (8, 0), (10, 2), (10, 22), (16, 28), (16, 36), (7, 36), (7, 58),
                    (4, 61), (0, 61),
                    close=True,
                )
            make_face()
        revolve(axis=Axis.Z)
        with Locations((0, 10, 12)):
            Box(30, 6, 8, mode=Mode.SUBTRACT)
    return p


FIRST = [
    bracket,
    flange,
    nut,
    shaft,
    channel,
    enclosure,
    plate,
    tee,
    house,
    heatsink,
    gear,
    pillow,
    dovetail,
    frustum,
    cube,
    beam,
    clamp,
    cam,
    stairs,
    vase,
    casting,
]
SECOND = [
    knob,
    hinge,
    tray,
    keyblock,
    pulley,
    arrow,
    bridge,
    vblock,
    elbow,
    castle,
    prismhole,
    lever,
]
ROUND = [
    dowel,
    ballknob,
    rivet,
    observatory,
    acornnut,
    dimple,
    roundedge,
    bullet,
]
THIRD = [
    pocket,
    slider,
    sockethead,
    gusset,
    tslot,
    steps,
    yoke,
    letter,
    wedge,
    ribs,
    cover,
    block,
]
FOURTH = [
    bushing,
    sunk,
    keyshaft,
    case,
    link,
    collar,
    drawer,
    spindle,
]
