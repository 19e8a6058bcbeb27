"""Metric depth from one camera and a speed signal.

Arrays are NumPy's. Depth is camera z in metres, 0 where there is none; images are H x W x 3, uint8, RGB. A camera's axes are x right,
y down, z forward, in metres. Intrinsics are fx, fy, cx, cy in pixels of the image that they belong to, with (0, 0) at the centre of
its first pixel. Transforms are named `target_from_source`.

The library's errors are raised as `DeepFusionError`, whose `hint` says what to do. Long calls release the GIL, and Ctrl-C ends them
with KeyboardInterrupt.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sized
from itertools import zip_longest
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._adapt import Adaptation, adapt
from ._events import (
    CameraEvent,
    PanelEvent,
    SavedEvent,
    StartedEvent,
    StepEvent,
    TrainEvent,
    ValidatedEvent,
    WarningEvent,
)
from ._native import Dataset, DeepFusionError, Frame, Model, Prediction, Predictions, __version__, drives
from ._perceive import Collision, Ground, Perception, Surroundings, Target, perceive
from ._snippets import Snippets
from ._train import Run, train
from ._types import Crop, DepthKind, Image, Precision, PredictionKind, Scene

__all__ = [
    "Adaptation",
    "CameraEvent",
    "Collision",
    "Dataset",
    "DeepFusionError",
    "Frame",
    "Ground",
    "Image",
    "Model",
    "PanelEvent",
    "Perception",
    "Prediction",
    "Predictions",
    "Run",
    "SavedEvent",
    "Snippets",
    "StartedEvent",
    "StepEvent",
    "Surroundings",
    "Target",
    "TrainEvent",
    "ValidatedEvent",
    "WarningEvent",
    "adapt",
    "devices",
    "doctor",
    "drives",
    "evaluate",
    "load",
    "networks",
    "perceive",
    "simulate",
    "train",
    "__version__",
]


def load(
    model: str | PathLike[str] = "street", *, precision: Precision = "f32", data_set: str | None = None, device: str = "cpu"
) -> Model:
    """Loads a trained network: a run folder, a checkpoint in it, a packed file, or an embedded network by its name (`networks()`).

    `precision` is "f32", "bf16" on processors with AMX or AVX512-BF16, or "int8" on those with AVX512-VNNI and AVX512-BF16, for
    networks calibrated by `deepfusion weights calibrate`. For a run that was trained on several data sets, `data_set` names the one
    whose metric scale to use (`--data-set` on the command line).

    `device` is "cpu", a GPU by its backend ("cuda", "vulkan", "wgpu", "metal"; "cuda:1" is the second one), or "auto": a GPU if the
    package supports one and the machine has one, else the processor. A GPU computes in f32. `devices()` lists the backends that the
    package was built with.
    """
    return _native.load(model, precision, data_set, device)


def networks() -> list[str]:
    """Names of the embedded networks."""
    return _native.networks()


def devices() -> list[str]:
    """Values of `device` that this package supports: "cpu", and the GPU backends that it was built with.

    In a checkout, `pip install ./python --config-settings=build-args="--features cuda"` builds it with CUDA.
    """
    return _native.devices()


def evaluate(
    predictions: Iterable[ArrayLike | Prediction],
    ground_truth: Iterable[ArrayLike | None],
    *,
    kind: PredictionKind = "depth",
    crop: Crop = "none",
    cap: float = 80.0,
    min_depth: float = 1e-3,
    allow_holes: bool = False,
    gt_depth: DepthKind = "z",
    scale: float | None = None,
    points: int = 0,
    points_seed: int = 0,
    names: Iterable[str] | None = None,
) -> dict[str, Any]:
    """Computes the field's seven metrics, unscaled and median-scaled: the report that `deepfusion eval --json` prints.

    `predictions` are H x W arrays of metres (`kind="depth"`) or of 1/m (`kind="disparity"`), of any size, or results of
    `Model.predict`, of which `kind` selects depth or disparity. `ground_truth` are H x W arrays of metres, 0 where nothing was
    measured; None leaves the image out. Both are consumed pair by pair, so generators work. `crop` is "none" or "garg"; only depths
    between `min_depth` and `cap` metres are measured.

    With `allow_holes`, predicted values that are NaN, infinite or not above 0 mean that there is no prediction: they are left out, and
    counted as `missing_rate`. `gt_depth` states in the report which depth the ground truth is: "z", "velodyne" or "annotated". `scale`
    adds a row with a fixed factor. `points` is the number of pixels to sample for the statistics of points, and `points_seed` decides
    which. `names` are the images' names in messages.
    """
    if isinstance(predictions, Sized) and isinstance(ground_truth, Sized) and len(predictions) != len(ground_truth):
        raise ValueError(f"predictions: expected {len(ground_truth)}, one for each image of ground_truth, found {len(predictions)}")
    if isinstance(names, Sized) and isinstance(ground_truth, Sized) and len(names) != len(ground_truth):
        raise ValueError(f"names: expected {len(ground_truth)}, one for each image of ground_truth, found {len(names)}")
    evaluation = _native.Evaluation(kind, crop, cap, min_depth, allow_holes, gt_depth, scale, points, points_seed)
    columns = (predictions, ground_truth) if names is None else (predictions, ground_truth, names)
    for i, row in enumerate(zip_longest(*columns, fillvalue=_ENDED)):
        ended = [name for name, value in zip(("predictions", "ground_truth", "names"), row) if value is _ENDED]
        if ended:
            raise ValueError(f"{' and '.join(ended)}: found only {i}, expected one for each image")
        prediction, truth = row[:2]
        if truth is None:
            continue
        if not isinstance(prediction, Prediction):
            prediction = _plane(prediction, f"predictions[{i}]")
        evaluation.add(row[2] if len(row) > 2 else f"{i:010}", prediction, _plane(truth, f"ground_truth[{i}]"))
    return json.loads(evaluation.report())


_ENDED = object()
"""Fills the row of an iterable that has ended."""


def _plane(values: ArrayLike, what: str) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2:
        raise ValueError(f"{what}: expected H x W, found {' x '.join(map(str, array.shape)) or 'a number'}")
    # A column of records is a view whose numbers are not contiguous.
    return np.require(array, np.float64, ["C", "ALIGNED"])


def simulate(
    out: str | PathLike[str],
    *,
    frames: int = 100,
    seed: int = 1,
    scene: Scene = "urban",
    moving_cars: int = 0,
    riders: int = 0,
    varied: bool = False,
    size: tuple[int, int] = (640, 192),
    scan_every: int = 1,
) -> Path:
    """Writes a simulated drive with exact depth, in KITTI's layout, into `out` (new or empty), and returns the drive's folder.

    `moving_cars` drive in the camera's direction or towards it. `riders` are people who ride bicycles, walk and cross the road (only
    on streets, in parks and on country roads), fewer if there is no room. `varied=True` draws the camera (lens, height, pitch, roll,
    softness, noise, exposure, JPEG), the light, the weather and the look of the street from the seed, once per drive: `varied.json`
    in the drive's folder records what was drawn, `scene` may also be "motorway" or "country", and cars whose way is blocked are left
    out. `size` is width and height in pixels. Every `scan_every`-th frame has a LiDAR scan; 0 writes none. Ctrl-C leaves `out` as it
    was, unless all frames are done.
    """
    width, height = size
    return _native.simulate(out, frames, seed, scene, moving_cars, riders, varied, width, height, scan_every)


def doctor(
    path: str | PathLike[str],
    *,
    intrinsics: ArrayLike | None = None,
    hfov_deg: float | None = None,
    topics: Mapping[str, str] | None = None,
    clock_offset_ms: float | None = None,
) -> dict[str, Any]:
    """Lists every reason why training on a recording would fail or give a wrong scale: the report that `deepfusion doctor PATH --json`
    prints. `path` may also be a speed log alone. What the recording lacks can be passed as to `Dataset`."""
    return json.loads(_native.doctor(path, intrinsics, hfov_deg, topics, clock_offset_ms))
