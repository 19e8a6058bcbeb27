"""Argument types."""

from __future__ import annotations

from os import PathLike
from typing import Any, Literal, Protocol, TypeAlias, Union

import numpy as np
from numpy.typing import NDArray

from ._native import Frame

__all__ = ["Camera", "Crop", "DepthKind", "Image", "Precision", "PredictionKind", "Scene"]


class _DLPack(Protocol):
    """An array of any library, on the CPU."""

    def __dlpack__(self) -> Any: ...
    def __dlpack_device__(self) -> tuple[Any, Any]: ...


class _Pil(Protocol):
    """A PIL image, or anything that converts like one."""

    def convert(self, mode: str, /) -> Any: ...


Image: TypeAlias = Union[NDArray[np.uint8], _DLPack, _Pil, Frame, str, "PathLike[str]"]
"""What a network predicts from: H x W x 3, uint8 (RGB), a PIL image, a frame of a recording, or a file."""

Camera: TypeAlias = Literal["2", "3"]
"""Left or right, if there are two."""
Crop: TypeAlias = Literal["none", "garg"]
DepthKind: TypeAlias = Literal["z", "velodyne", "annotated"]
"""Camera z; the velodyne's forward distance; KITTI's `proj_depth`."""
Precision: TypeAlias = Literal["f32", "bf16", "int8"]
PredictionKind: TypeAlias = Literal["depth", "disparity"]
Scene: TypeAlias = Literal["urban", "park", "garage", "commercial", "night", "indoor", "motorway", "country"]
