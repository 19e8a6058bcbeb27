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
    """Metric depth of an image."""

    @property
    def depth(self) -> NDArray[np.float32]:
        """H x W metres at the image's size; 0 outside the part that the network looked at. Computed once; always the same array."""
    @property
    def sigma(self) -> NDArray[np.float32] | None:
        """Standard deviation of `depth` in metres, H x W, scaled by what was found for the network, as `deepfusion predict` writes it;
        None for a network that does not predict it. Computed once; always the same array."""
    @property
    def confidence(self) -> NDArray[np.float32] | None:
        """How far each pixel of `depth` can be trusted, H x W, 0 to 1: exp(-expected error of ln depth), 0.9 for 10 %; None for a
        network that does not predict it. Scaled like `sigma`. Computed once; always the same array."""
    @property
    def disparity(self) -> NDArray[np.float32]:
        """Disparity in 1/m, at the network's size. Computed once; always the same array."""
    @property
    def intrinsics(self) -> _Intrinsics | None:
        """fx, fy, cx, cy of the image, if they are known."""
    def __dlpack__(self, **options: Any) -> Any:
        """Exports `depth`: `torch.from_dlpack(prediction)` shares its memory."""
    def __dlpack_device__(self) -> tuple[int, int]: ...
    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """`depth` itself: `np.asarray(prediction)` is this very array."""
    def __reduce__(self) -> NoReturn: ...
    def cloud(self, max_depth: float = 80.0) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Points, N x 3 in metres (x right, y down, z forward), and their colours, N x 3, from `depth` as it is now; needs
        `intrinsics`."""

@final
class Model:
    """A trained network. Calls from several threads wait for each other; use `another()` for a second thread."""

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
        """Predicts the depth of an H x W x 3 array (uint8, RGB; NumPy's, or another library's on the CPU by DLPack), a PIL image, a
        file, or a frame of a recording. The camera is `intrinsics` (fx, fy, cx, cy, or the 3 x 3 matrix), or is given by
        `hfov_deg`, the horizontal field of view in degrees. Without either, a frame has its own camera, and a file, or what PIL
        opened from one, its EXIF data. If there is none, the training camera's lens is assumed, Python warns once, and the metres
        are only as right as that assumption.

        `focal_correction` corrects depth for a focal length other than the training camera's; `stretch` shows the network the whole
        image where it would be cropped to the training images' aspect ratio. `post_process` averages two or four predictions of the
        image (the image and the mirrored one; a smaller input and a larger one; both): this usually lowers the error on real
        streets, and takes two to five times as long. Several sizes are for networks trained at several sizes, such as `street`."""
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
        """Predicts images of one camera, or frames, in their order, as `predict` does. While the network works on one image, the next
        ones are read and prepared on other threads, as in `deepfusion predict`. What is wrong with an image is raised when its turn
        comes; calling `next` again continues with the images after it. `ahead` is how many may be on their way at once, by default
        a few per thread; one thread at a time takes the predictions."""
    def another(self) -> Model:
        """The same network for another thread; it shares the weights."""
    @property
    def size(self) -> tuple[int, int]:
        """Width and height that it was trained with."""
    @property
    def step(self) -> int:
        """Steps that it was trained for."""
    @property
    def engine(self) -> str:
        """The engine that runs it: "fused" on a processor ("fused-bf16", "fused-int8"), "burn" on a GPU."""
    @property
    def device(self) -> str:
        """The device that it runs on, such as "cpu" or "cuda:1"."""
    def __reduce__(self) -> tuple[Any, ...]:
        """Unpickling loads it again: the weights stay where they are."""

@final
class Predictions(Iterator[Prediction]):
    """The iterator that `Model.predict_many` returns."""

    def __iter__(self) -> Predictions: ...
    def __next__(self) -> Prediction: ...

@final
class Frame:
    """One frame of a recording."""

    @property
    def image(self) -> NDArray[np.uint8]:
        """H x W x 3, RGB, without lens distortion. Read on each access."""
    @property
    def number(self) -> int:
        """Number of the frame in the recording's files."""
    @property
    def time_s(self) -> float | None:
        """When it was taken, in seconds from the recording's first time stamp."""
    @property
    def speed_mps(self) -> float | None:
        """Speed of the vehicle."""
    @property
    def yaw_rate_radps(self) -> float | None:
        """How fast the vehicle turned since the previous frame, in radians per second, positive to the left; None if that is not
        known, and for the first frame."""
    @property
    def intrinsics(self) -> _Intrinsics:
        """fx, fy, cx, cy in pixels of `image`."""
    @property
    def K(self) -> NDArray[np.float64]:
        """`intrinsics` as the 3 x 3 matrix fx 0 cx, 0 fy cy, 0 0 1, float64."""
    def ground_truth(self, kind: DepthKind = "z") -> NDArray[np.float32] | None:
        """H x W metres, 0 where nothing was measured; None if the frame has no ground truth. `kind`: "z", "velodyne" or "annotated"
        (KITTI's `proj_depth`)."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]:
        """Unpickling opens the recording again and gives the same frame."""

@final
class Dataset:
    """A recording of any known layout: one drive, one camera. `recording[i]` reads nothing but what is known about the frame."""

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
        """`camera` is "2" (left) or "3" (right) if there are two; `drive` selects one of several below `path`, counted from 0.

        Pass what the recording does not say: its camera as `intrinsics` (fx, fy, cx, cy in pixels of its images, or the 3 x 3
        matrix), `hfov_deg` (horizontal field of view) or `calibration` (a file); a bag's topics by role as `topics` (`{"image":
        "/camera/front"}`; roles: image, camera_info, lidar, dynamic, imu, speed, steering, can, truth); as `clock_offset_ms`, how
        far the camera's clock is ahead of the vehicle's. `split` is a file that selects frames."""
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int, /) -> Frame: ...
    @overload
    def __getitem__(self, index: slice, /) -> list[Frame]: ...
    def __iter__(self) -> Iterator[Frame]: ...
    @property
    def name(self) -> str:
        """Name of the drive."""
    @property
    def layout(self) -> str:
        """The recording's layout, such as "KITTI raw"."""
    @property
    def times_s(self) -> NDArray[np.float64]:
        """When each frame was taken, in seconds from the recording's first time stamp; NaN if that is not known."""
    @property
    def speeds_mps(self) -> NDArray[np.float64]:
        """The vehicle's speed at each frame; NaN if that is not known."""
    @property
    def numbers(self) -> NDArray[np.int64]:
        """Number of each frame in the recording's files."""
    @property
    def camera_yaw_rad(self) -> float | None:
        """How far the camera looks to the left of straight ahead, in radians; 0 if nothing says how it is mounted, None for a camera
        that looks to the side or back (more than 60 degrees)."""
    @property
    def warnings(self) -> list[str]:
        """What was assumed, looks odd or could not be read although the recording was opened, one line each. `Dataset(...)` issues
        them as warnings (UserWarning)."""
    def motion(self, source: int, target: int) -> NDArray[np.float64] | None:
        """4 x 4, target_from_source: transforms a point from the camera at frame `source` to the camera at frame `target`; None if the
        vehicle's motion is not known. Negative numbers count frames from the end, as in `recording[-1]`."""
    def __getnewargs_ex__(self) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """Unpickling opens it again: the recording itself stays where it is."""

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
    """Every drive below `path`, each opened as a `Dataset`; the options apply to all of them."""

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
