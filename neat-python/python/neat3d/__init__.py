"""Posed photographs in, one 3D wireframe out: junctions joined by line segments.

>>> import neat3d
>>> run = neat3d.reconstruct("SCENE")                    # or neat3d.Scene.from_arrays(...)
>>> run.wireframe.segments                               # (E, 2, 3)
>>> run.wireframe.export("house.dxf")

Lengths and positions are in the unit and frame of your files; cameras follow OpenCV.
"""

from ._neat3d import (
    FORMATS,
    KINDS,
    PRESETS,
    Field,
    Run,
    Scene,
    Segments,
    Wireframe,
    __version__,
    detect,
    evaluate,
    reconstruct,
)
from .errors import InputError, Interrupted, NeatError, NeatWarning, RunError

__all__ = [
    "FORMATS",
    "KINDS",
    "PRESETS",
    "Field",
    "InputError",
    "Interrupted",
    "NeatError",
    "NeatWarning",
    "Run",
    "RunError",
    "Scene",
    "Segments",
    "Wireframe",
    "__version__",
    "detect",
    "evaluate",
    "reconstruct",
]
