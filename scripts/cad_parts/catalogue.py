"""Parts as others draw them: plates, profiles, a gear, a screw and a flange of bd_warehouse 0.2.0, and a
compartment box and its base of gfthings 0.8.3, as these packages make them. They ask for a newer
build123d than they need: `pip install --no-deps bd_warehouse==0.2.0 gfthings==0.8.3`."""

from bd_warehouse import fastener, flange, gear, open_builds
from build123d import MM, BuildPart, add
from gfthings import Base, Bin


def part(make):
    """A function as those of `shapes`, with the name of `make`."""

    def built():
        with BuildPart() as p:
            add(make())
        return p

    built.__name__ = make.__name__
    return built


@part
def endmount():
    return open_builds.CBeamEndMount()


@part
def rail():
    return open_builds.VSlotLinearRail("20x20", 30 * MM)


@part
def spacer():
    return open_builds.SpacerBlock()


@part
def riser():
    return open_builds.CBeamRiserPlate()


@part
def gantry():
    return open_builds.CBeamGantryPlate()


@part
def coupler():
    return open_builds.FlexibleCoupler("1/4in")


@part
def nutblock():
    return open_builds.AcmeAntiBacklashNutBlock8mm()


@part
def spur():
    return gear.SpurGear(
        module=2, tooth_count=12, pressure_angle=20, thickness=8, root_fillet=None
    )


@part
def capscrew():
    return fastener.SocketHeadCapScrew("M8-1.25", 16, simple=True)


@part
def weldneck():
    return flange.WeldNeckFlange(nps="2", flange_class=300, face_type="Raised")


@part
def bin():
    return Bin.Bin(1, 2, 3, 0.0, divisions=2)


@part
def grid():
    return Base.BaseGrid(1, 2)


CATALOGUE = [
    endmount, rail, spacer, riser, gantry, coupler, nutblock, spur, capscrew, weldneck, bin, grid,
]  # fmt: skip
