"""Metric depth from one camera and a speed signal.

Arrays are NumPy's. Depth is camera z in metres, 0 where there is none; images are H x W x 3, uint8, RGB. A camera's axes are x right,
y down, z ahead, in metres. Intrinsics are fx, fy, cx, cy in pixels of the image they are given with, (0, 0) the centre of the first one.
A transform is named `target_from_source`.

What the library cannot do raises `DeepFusionError`, whose `hint` says what to do about it. Long calls release the interpreter, and
Ctrl-C ends them with KeyboardInterrupt.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from . import _native
from ._adapt import Adaptation, adapt
from ._native import Dataset, DeepFusionError, Frame, Model, Prediction, Predictions, __version__
from ._perceive import Collision, Ground, Perception, Surroundings, Target, perceive
from ._snippets import Snippets
from ._train import Run, TrainEvent, train

__all__ = [
    "Adaptation",
    "Collision",
    "Dataset",
    "DeepFusionError",
    "Frame",
    "Ground",
    "Model",
    "Perception",
    "Prediction",
    "Predictions",
    "Run",
    "Snippets",
    "Surroundings",
    "Target",
    "TrainEvent",
    "adapt",
    "devices",
    "doctor",
    "evaluate",
    "load",
    "networks",
    "perceive",
    "simulate",
    "train",
    "__version__",
]


def load(
    model: str | PathLike[str] = "street", *, precision: str = "f32", data_set: str | None = None, device: str = "cpu"
) -> Model:
    """A trained network: a run's folder, a checkpoint in it, a packed file, or the name of an embedded one (`networks()`).

    `precision` is "f32", "bf16" on processors with AMX or AVX512-BF16, or "int8" on those with AVX512-VNNI, for networks that
    `deepfusion weights calibrate` has seen. `data_set` names one of the data sets that a run
    learned from, where it learned several: its metres are meant (`--data-set` on the command line).

    `device` is "cpu", a GPU by its backend ("cuda", "vulkan", "wgpu", "metal"; "cuda:1" is the second one), or "auto": a GPU where package
    and machine have one, else the processor. A GPU computes in f32. `devices()` are the backends that the package was built with.
    """
    return _native.load(model, precision, data_set, device)


def networks() -> list[str]:
    """The names of the networks inside the package."""
    return _native.networks()


def devices() -> list[str]:
    """The backends that this package was built with, as `device` names them: "cpu", and those of GPUs that were asked for.

    `pip install ./python --config-settings=build-args="--features cuda"` in a checkout builds it with CUDA.
    """
    return _native.devices()


def evaluate(
    predictions: Sequence[Any],
    ground_truth: Sequence[Any],
    *,
    kind: str = "depth",
    crop: str = "none",
    cap: float = 80.0,
    min_depth: float = 1e-3,
    names: Sequence[str] | None = None,
) -> dict[str, Any]:
    """The field's seven metrics, unscaled and median-scaled: what `deepfusion eval --json` prints.

    `predictions` are H x W arrays of metres (`kind="depth"`) or of 1/m (`kind="disparity"`), of any size; `ground_truth`
    H x W arrays of metres, 0 where nothing was measured. `crop` is "none" or "garg"; what is measured lies between `min_depth`
    and `cap` metres.
    """
    if len(predictions) != len(ground_truth):
        raise ValueError(f"{len(predictions)} predictions for {len(ground_truth)} images of ground truth")
    if names is None:
        names = [f"{i:010}" for i in range(len(ground_truth))]
    if len(names) != len(ground_truth):
        raise ValueError(f"{len(names)} names for {len(ground_truth)} images")
    pairs = [
        (name, np.ascontiguousarray(p, dtype=np.float64), np.ascontiguousarray(t, dtype=np.float64))
        for name, p, t in zip(names, predictions, ground_truth)
    ]
    return json.loads(_native.evaluate(pairs, kind, crop, cap, min_depth))


def simulate(
    out: str | PathLike[str],
    *,
    frames: int = 100,
    seed: int = 1,
    scene: str = "urban",
    moving_cars: int = 0,
    riders: int = 0,
    varied: bool = False,
    size: tuple[int, int] = (640, 192),
    scan_every: int = 1,
) -> Path:
    """Writes a simulated drive with exact depth in KITTI's layout into `out`, new or empty, and gives the drive's folder.

    `moving_cars` drive along or towards the camera; `riders` are people who ride bicycles, walk and cross the road (streets, parks and country roads only),
    fewer where there is no room. `varied=True` draws the camera (lens, height, pitch, roll, softness, noise, exposure, JPEG), the light, the weather and what
    the street looks like from the seed, once for the drive: `varied.json` in the drive's folder says what was drawn, `scene` may be "motorway" or "country",
    too, and only those cars drive that nothing on the street stops. `size` is width and height in pixels; `scan_every` says which frames have a LiDAR scan, 0 none. Ctrl-C leaves `out` as it was, unless all frames are done.
    """
    width, height = size
    return _native.simulate(out, frames, seed, scene, moving_cars, riders, varied, width, height, scan_every)


def doctor(path: str | PathLike[str]) -> dict[str, Any]:
    """Every reason why training on a recording would fail or give a wrong scale: what `deepfusion doctor PATH --json` prints."""
    return json.loads(_native.doctor(path))
