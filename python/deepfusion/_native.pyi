from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NoReturn, TypeAlias, final, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from ._events import TrainEvent
from ._types import Camera, DepthKind, Image

__all__ = [
    "Dataset",
    "DeepFusionError",
    "Evaluation",
    "Frame",
    "Model",
    "Perception",
    "Prediction",
    "Predictions",
    "__version__",
    "adapt",
    "check_device",
    "command",
    "devices",
    "doctor",
    "drives",
    "fastest",
    "load",
    "networks",
    "simulate",
    "train",
    "undo_adaptation",
]

__version__: str

_Intrinsics: TypeAlias = tuple[float, float, float, float]
_PostProcess: TypeAlias = Literal["flip", "multi-scale", "multi-scale-flip"]

class DeepFusionError(Exception):
    """What went wrong, with the file, frame or field; `hint` says what to do about it."""

    hint: str | None

@final
class Prediction:
    """The metric depth of an image."""

    @property
    def depth(self) -> NDArray[np.float32]:
        """H x W metres at the image's size; 0 outside of what the network looked at. One array, made once."""
    @property
    def sigma(self) -> NDArray[np.float32] | None:
        """Standard deviation of `depth` in metres, H x W, stretched by what was found for the network, as `deepfusion predict` writes it; None of
        a network that does not say. One array, made once."""
    @property
    def confidence(self) -> NDArray[np.float32] | None:
        """How far each pixel of `depth` can be trusted, H x W, 0 to 1: exp(-the error of ln depth that is to be expected), 0.9 for 10 %;
        None of a network that does not say. Stretched as `sigma`. One array, made once."""
    @property
    def disparity(self) -> NDArray[np.float32]:
        """1/m, at the network's size. One array, made once."""
    @property
    def intrinsics(self) -> _Intrinsics | None:
        """fx, fy, cx, cy of the image, where they are known."""
    def __dlpack__(self, **options: Any) -> Any:
        """`depth`'s: `torch.from_dlpack(prediction)` shares its memory."""
    def __dlpack_device__(self) -> tuple[int, int]: ...
    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """`depth`: `np.asarray(prediction)` is that very array."""
    def __reduce__(self) -> NoReturn: ...
    def cloud(self, max_depth: float = 80.0) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Points N x 3 in metres (x right, y down, z ahead) and their colours N x 3, of `depth` as it stands there; needs `intrinsics`."""

@final
class Model:
    """A trained network. Calls on several threads wait for each other; `another()` is for a second thread."""

    def predict(
        self,
        image: Image,
        intrinsics: ArrayLike | None = None,
        *,
        hfov_deg: float | None = None,
        focal_correction: bool = True,
        stretch: bool = False,
        post_process: _PostProcess | None = None,
    ) -> Prediction:
        """Depth of an H x W x 3 array (uint8, RGB; NumPy's, or another's on the processor by DLPack), a PIL image, a file, or a frame of a
        recording. The camera is `intrinsics` (fx, fy, cx, cy, or the 3 x 3 matrix), or the one that sees `hfov_deg` degrees from left to right;
        without either a frame has its own, and EXIF is asked, of a file or of what PIL opened from one. Then the lens of the training camera is
        assumed, of which Python is warned once, and the metres are as right as that.

        `focal_correction` multiplies depth for a focal length other than the one trained with; `stretch` shows the network the whole
        image where it would be cut to the aspect ratio trained with. `post_process` takes the mean of two predictions of the image or of four
        (the image and the mirrored one; a smaller input and a larger one; both): it usually errs less on real streets, and takes two to
        five times as long. Several sizes are for networks that learned at several, as `street` did."""
    def predict_many(
        self,
        images: Iterable[Image],
        intrinsics: ArrayLike | None = None,
        *,
        hfov_deg: float | None = None,
        focal_correction: bool = True,
        stretch: bool = False,
        post_process: _PostProcess | None = None,
        ahead: int | None = None,
    ) -> Predictions:
        """The predictions of images of one camera, or of frames, in their order, as `predict` gives them. While the network looks at one, the next
        are read and prepared on other threads, as `deepfusion predict` does it. What is wrong with an image is raised at its turn;
        going on with `next` gives those behind it. `ahead` is how many may be on their way at once, by default some for each thread; one thread
        takes them at a time."""
    def another(self) -> Model:
        """The same network for another thread: it shares the weights."""
    @property
    def size(self) -> tuple[int, int]:
        """Width and height trained with."""
    @property
    def step(self) -> int:
        """Steps it was trained for."""
    @property
    def engine(self) -> str:
        """What runs it: "fused" on a processor ("fused-bf16", "fused-int8"), "burn" on a GPU."""
    @property
    def device(self) -> str:
        """Where it runs: "cpu", "cuda:1"."""
    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled, it is loaded again: the weights stay where they are."""

@final
class Predictions(Iterator[Prediction]):
    """Of `Model.predict_many`."""

    def __iter__(self) -> Predictions: ...
    def __next__(self) -> Prediction: ...

@final
class Frame:
    """One frame of a recording."""

    @property
    def image(self) -> NDArray[np.uint8]:
        """H x W x 3, RGB, free of the lens's distortion. Read when asked for."""
    @property
    def number(self) -> int:
        """Its number in the recording's files."""
    @property
    def time_s(self) -> float | None:
        """When it was taken, seconds from the recording's first stamp."""
    @property
    def speed_mps(self) -> float | None:
        """The vehicle's."""
    @property
    def yaw_rate_radps(self) -> float | None:
        """How fast the vehicle turned since the frame before, radians a second, positive to the left; None where that is not known, and of the
        first frame."""
    @property
    def intrinsics(self) -> _Intrinsics:
        """fx, fy, cx, cy in pixels of `image`."""
    @property
    def K(self) -> NDArray[np.float64]:
        """`intrinsics` as the 3 x 3 matrix fx 0 cx, 0 fy cy, 0 0 1, float64."""
    def ground_truth(self, kind: DepthKind = "z") -> NDArray[np.float32] | None:
        """H x W metres, 0 where nothing was measured; None where the frame has none. `kind`: "z", "velodyne" or
        "annotated" (KITTI's `proj_depth`)."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled, it is the same frame of the recording, which is opened again."""

@final
class Dataset:
    """A recording of any known layout: one drive, one camera. `recording[i]` reads nothing but what is known of the frame."""

    def __new__(
        cls,
        path: str | PathLike[str],
        *,
        camera: Camera = "2",
        drive: int = 0,
        intrinsics: ArrayLike | None = None,
        hfov_deg: float | None = None,
        calibration: str | PathLike[str] | None = None,
        topics: Mapping[str, str] | None = None,
        clock_offset_ms: float | None = None,
        split: str | PathLike[str] | None = None,
    ) -> Dataset:
        """`camera` is "2" (left) or "3" (right) where there are two; `drive` says which of several below `path`, from 0.

        What a recording does not say: `intrinsics` (fx, fy, cx, cy in pixels of its images, or the 3 x 3 matrix), `hfov_deg` (its view from left
        to right) or `calibration` (a file) is its camera; `topics` are those of a bag by role (`{"image": "/camera/front"}`; roles: image,
        camera_info, lidar, dynamic, imu, speed, steering, can, truth); `clock_offset_ms` is how far the camera's clock is ahead of the vehicle's.
        `split` is a file whose frames alone are meant."""
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int, /) -> Frame: ...
    @overload
    def __getitem__(self, index: slice, /) -> list[Frame]: ...
    def __iter__(self) -> Iterator[Frame]: ...
    @property
    def name(self) -> str:
        """The drive's."""
    @property
    def layout(self) -> str:
        """Such as "KITTI raw"."""
    @property
    def times_s(self) -> NDArray[np.float64]:
        """When each frame was taken, seconds from the recording's first stamp; NaN where that is not known."""
    @property
    def speeds_mps(self) -> NDArray[np.float64]:
        """The vehicle's speed at each frame; NaN where that is not known."""
    @property
    def numbers(self) -> NDArray[np.int64]:
        """Each frame's number in the recording's files."""
    @property
    def camera_yaw_rad(self) -> float | None:
        """By how much the camera looks to the left of the way straight ahead, radians; 0 where nothing says its mount, None for one that
        looks to the side or back (more than 60 degrees)."""
    @property
    def warnings(self) -> list[str]:
        """What was taken for granted, looks odd or cannot be read, though it was opened: a line each. `Dataset(...)` warns of them (UserWarning)."""
    def motion(self, source: int, target: int) -> NDArray[np.float64] | None:
        """4 x 4, target_from_source: takes a point of the camera at frame `source` to the camera at frame `target`; None where
        the vehicle's motion is not known. Below 0 frames are counted from the end, as in `recording[-1]`."""
    def __getnewargs_ex__(self) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """Pickled, it is opened again: the recording itself stays where it is."""

def drives(
    path: str | PathLike[str],
    *,
    camera: Camera = "2",
    intrinsics: ArrayLike | None = None,
    hfov_deg: float | None = None,
    calibration: str | PathLike[str] | None = None,
    topics: Mapping[str, str] | None = None,
    clock_offset_ms: float | None = None,
    split: str | PathLike[str] | None = None,
) -> list[Dataset]:
    """Every drive below `path`, as `Dataset` opens one; what is said is said of all of them."""

def load(model: Any, precision: str, data_set: str | None, device: str) -> Model: ...
def networks() -> list[str]: ...
def devices() -> list[str]: ...
def fastest() -> str: ...
def check_device(device: str) -> None: ...
def simulate(
    out: Any,
    frames: int,
    seed: int,
    scene: str,
    moving_cars: int,
    riders: int,
    varied: bool,
    width: int,
    height: int,
    scan_every: int,
) -> Path: ...
def doctor(
    path: Any, intrinsics: ArrayLike | None, hfov_deg: float | None, topics: Mapping[str, str] | None, clock_offset_ms: float | None
) -> str: ...
def train(asked: dict[str, Any], callback: Callable[[TrainEvent], bool | None] | None) -> dict[str, Any]: ...
def adapt(asked: dict[str, Any], callback: Callable[[TrainEvent], bool | None] | None) -> str: ...
def undo_adaptation(out: Any) -> None: ...
def command(arguments: Sequence[str]) -> int: ...

@final
class Perception:
    def __new__(cls, settings: str, exact: bool) -> Perception: ...
    def reset(self) -> None: ...
    def detect(
        self,
        depth: NDArray[np.float32],
        intrinsics: ArrayLike,
        sigma: NDArray[np.float32] | None,
        time_s: float | None,
        world_from_cam: NDArray[np.float64] | None,
        speed_mps: float | None,
        yaw_rate_radps: float,
        camera_yaw_rad: float | None,
    ) -> str: ...

@final
class Evaluation:
    def __new__(
        cls,
        kind: str,
        crop: str,
        cap: float,
        min_depth: float,
        allow_holes: bool,
        gt_depth: str,
        scale: float | None,
        points: int,
        points_seed: int,
    ) -> Evaluation: ...
    def add(self, name: str, prediction: Prediction | NDArray[np.float64], truth: NDArray[np.float64]) -> None: ...
    def report(self) -> str: ...
