"""To and from packages of others, which are imported only when they are asked for."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._neat3d import Scene
from .errors import InputError

if TYPE_CHECKING:
    from ._neat3d import Wireframe

__all__ = ["from_pycolmap", "to_open3d", "to_trimesh"]


def to_trimesh(wireframe: Wireframe) -> Any:
    """The edges as a ``trimesh.path.Path3D``: one line per edge, vertices shared."""
    from trimesh.path import Path3D
    from trimesh.path.entities import Line

    lines = [Line([int(start), int(end)]) for start, end in wireframe.edges]
    return Path3D(entities=lines, vertices=wireframe.junctions.copy(), process=False)


def to_open3d(wireframe: Wireframe) -> Any:
    """The edges as an ``open3d.geometry.LineSet``, vertices shared."""
    from open3d.geometry import LineSet
    from open3d.utility import Vector2iVector, Vector3dVector

    lines = wireframe.edges.astype("int32")
    return LineSet(Vector3dVector(wireframe.junctions.copy()), Vector2iVector(lines))


def from_pycolmap(
    reconstruction: Any,
    images: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    keep: object = None,
) -> Scene:
    """A scene in ``folder``; see :meth:`neat3d.Scene.from_pycolmap`. ``keep`` lives as long."""
    folder = Path(folder)
    if folder.exists() and any(folder.iterdir()):
        raise InputError(f"{folder} is not empty: choose another folder for the scene")
    model = folder / "sparse" / "0"
    model.mkdir(parents=True)
    reconstruction.write(str(model))
    for image in reconstruction.images.values():
        source, target = Path(images) / image.name, folder / "images" / image.name
        if not source.is_file():
            raise InputError(f"{source} does not exist: give the folder that image names start in")
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(source.resolve(), target)
        except OSError:  # another disk, or a system without such links
            shutil.copyfile(source, target)
    return Scene(folder, keep=keep)
