import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Path: TypeAlias = str | os.PathLike[str]
_Settings: TypeAlias = Mapping[str, Any] | Sequence[str]
_Floats: TypeAlias = NDArray[np.float64]
_Indices: TypeAlias = NDArray[np.int64]
_Image: TypeAlias = NDArray[np.uint8]

__all__ = [
    "FORMATS",
    "KINDS",
    "PRESETS",
    "Field",
    "Run",
    "Scene",
    "Segments",
    "Wireframe",
    "__version__",
    "detect",
    "evaluate",
    "reconstruct",
]

__version__: Final[str]
FORMATS: Final[list[str]]
KINDS: Final[list[str]]
PRESETS: Final[list[str]]

@final
class Segments:
    @property
    def ends(self) -> _Floats: ...
    @property
    def scores(self) -> _Floats: ...
    @property
    def vertices(self) -> _Floats: ...
    @property
    def edges(self) -> _Indices: ...
    def __len__(self) -> int: ...

@final
class Scene:
    def __new__(cls, folder: _Path, *, keep: object | None = None) -> Scene: ...
    @staticmethod
    def from_arrays(
        images: Sequence[_Image],
        K: ArrayLike,
        poses: ArrayLike,
        *,
        names: Sequence[str] | None = None,
        segments: Sequence[Segments | ArrayLike] | None = None,
        points: ArrayLike | None = None,
        pixel_center: float = 0.5,
        name: str | None = None,
        folder: _Path | None = None,
    ) -> Scene: ...
    @staticmethod
    def from_pycolmap(
        reconstruction: Any,
        images: _Path,
        *,
        name: str | None = None,
        folder: _Path | None = None,
    ) -> Scene: ...
    @staticmethod
    def synth(folder: _Path, **settings: Any) -> Scene: ...
    @property
    def folder(self) -> Path: ...
    @property
    def names(self) -> list[str]: ...
    @property
    def K(self) -> _Floats: ...
    @property
    def poses(self) -> _Floats: ...
    @property
    def points(self) -> _Floats: ...
    def image(self, view: int) -> _Image: ...
    def segments(self, view: int) -> Segments: ...
    def __len__(self) -> int: ...

@final
class Wireframe:
    def __new__(cls, junctions: ArrayLike, edges: ArrayLike) -> Wireframe: ...
    @staticmethod
    def read(path: _Path) -> Wireframe: ...
    @property
    def junctions(self) -> _Floats: ...
    @property
    def edges(self) -> _Indices: ...
    @property
    def segments(self) -> _Floats: ...
    @property
    def covariances(self) -> _Floats: ...
    @property
    def probabilities(self) -> _Floats | None: ...
    @property
    def kinds(self) -> _Floats | None: ...
    @property
    def arcs(self) -> dict[str, _Floats]: ...
    @property
    def splines(self) -> dict[str, NDArray[Any]]: ...
    @property
    def domes(self) -> list[dict[str, Any]]: ...
    @property
    def shells(self) -> list[dict[str, Any]]: ...
    @property
    def edge_fields(self) -> dict[str, _Floats]: ...
    @property
    def junction_fields(self) -> dict[str, _Floats]: ...
    @property
    def views(self) -> list[str]: ...
    @property
    def support(self) -> list[list[tuple[int, list[float], float]]]: ...
    @property
    def metadata(self) -> dict[str, Any]: ...
    def filter(
        self,
        *,
        min_probability: float | None = None,
        min_views: int | None = None,
        only_structure: bool = False,
    ) -> Wireframe: ...
    def export(
        self,
        path: _Path,
        format: str | None = None,
        *,
        view: str | None = None,
        width: int | None = None,
        unit: str | None = None,
        up: str | None = None,
    ) -> list[Path]: ...
    def to_trimesh(self) -> Any: ...
    def to_open3d(self) -> Any: ...
    def __len__(self) -> int: ...

@final
class Run:
    def __new__(cls, folder: _Path) -> Run: ...
    @property
    def folder(self) -> Path: ...
    @property
    def wireframe(self) -> Wireframe: ...
    @property
    def report(self) -> Path: ...
    @property
    def manifest(self) -> dict[str, Any]: ...
    def field(
        self, scene: _Path | None = None, *, backend: str = "auto", threads: int | None = None
    ) -> Field: ...

@final
class Field:
    def __call__(self, points: ArrayLike) -> _Floats: ...
    def distance(self, points: ArrayLike) -> _Floats: ...
    def gradient(self, points: ArrayLike) -> _Floats: ...
    def segments(self, points: ArrayLike, directions: ArrayLike | None = None) -> _Floats: ...
    @property
    def junctions(self) -> _Floats: ...

def detect(
    image: _Image,
    settings: _Settings | None = None,
    *,
    segments: ArrayLike | None = None,
    threads: int | None = None,
) -> Segments: ...
def evaluate(
    predicted: Wireframe | _Path,
    truth: Wireframe | _Path | None = None,
    *,
    points: ArrayLike | _Path | None = None,
    scene: _Path | None = None,
    protocols: Sequence[str] | None = None,
    threads: int | None = None,
) -> list[dict[str, Any]]: ...
def reconstruct(
    scene: Scene | _Path,
    out: _Path | None = None,
    *,
    preset: str | None = None,
    config: _Path | None = None,
    settings: _Settings | None = None,
    seed: int | None = None,
    threads: int | None = None,
    backend: str = "auto",
    train: bool = False,
    time_budget: float | None = None,
    resume: bool = False,
    overwrite: bool = False,
    examine: bool = True,
    cache: bool = True,
    memory_limit: int | None = None,
    progress: Callable[[dict[str, Any]], object] | None = None,
) -> Run: ...
