from collections.abc import Iterator
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

Intrinsics = tuple[float, float, float, float]

class DeepFusionError(Exception):
    """What went wrong, with the file, frame or field; `hint` says what to do about it."""

    hint: str | None

class Prediction:
    """The metric depth of an image."""

    @property
    def depth(self) -> NDArray[np.float32]:
        """H x W metres at the image's size; 0 outside of what the network looked at. One array, made once."""
    @property
    def sigma(self) -> NDArray[np.float32] | None:
        """Standard deviation of `depth` in metres, H x W; None of a network that does not say. Not calibrated."""
    @property
    def disparity(self) -> NDArray[np.float32]:
        """1/m, at the network's size."""
    @property
    def intrinsics(self) -> Intrinsics | None:
        """fx, fy, cx, cy of the image, where they are known."""
    def cloud(self, max_depth: float = 80.0) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Points N x 3 in metres (x right, y down, z ahead) and their colours N x 3; needs `intrinsics`."""

class Model:
    """A trained network. Calls on several threads wait for each other; `another()` is for a second thread."""

    def predict(
        self,
        image: NDArray[np.uint8] | str | PathLike[str] | Any,
        intrinsics: Intrinsics | None = None,
        *,
        focal_correction: bool = True,
        stretch: bool = False,
    ) -> Prediction:
        """Depth of an H x W x 3 array (uint8, RGB), a PIL image, or a file. Without `intrinsics` a file's EXIF is asked, then
        the lens of the training camera is assumed, and the metres are as right as that."""
    def another(self) -> Model:
        """The same network for another thread: it shares the weights."""
    @property
    def size(self) -> tuple[int, int]:
        """Width and height trained with."""
    @property
    def step(self) -> int:
        """Steps it was trained for."""
    @property
    def engine(self) -> str: ...

class Frame:
    """One frame of a recording."""

    @property
    def image(self) -> NDArray[np.uint8]:
        """H x W x 3, RGB, free of the lens's distortion. Read when asked for."""
    @property
    def number(self) -> int: ...
    @property
    def time_s(self) -> float | None: ...
    @property
    def speed_mps(self) -> float | None: ...
    @property
    def intrinsics(self) -> Intrinsics: ...
    def ground_truth(self, kind: str = "z") -> NDArray[np.float32] | None:
        """H x W metres, 0 where nothing was measured; None where the frame has none. `kind`: "z" or "velodyne"."""

class Dataset:
    """A recording of any known layout: one drive, one camera."""

    def __init__(self, path: str | PathLike[str], *, camera: str = "2", drive: int = 0) -> None: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: int) -> Frame: ...
    def __iter__(self) -> Iterator[Frame]: ...
    @property
    def name(self) -> str: ...
    @property
    def layout(self) -> str: ...
    def motion(self, source: int, target: int) -> NDArray[np.float64] | None:
        """4 x 4, target_from_source: takes a point of the camera at frame `source` to the camera at frame `target`; None where
        the vehicle's motion is not known."""

def load(model: Any, precision: str, data_set: str | None) -> Model: ...
def networks() -> list[str]: ...
def evaluate(pairs: Any, kind: str, crop: str, cap: float, min_depth: float) -> str: ...
def simulate(
    out: Any, frames: int, seed: int, scene: str, moving_cars: int, width: int, height: int, scan_every: int
) -> str: ...
def doctor(path: Any) -> str: ...
