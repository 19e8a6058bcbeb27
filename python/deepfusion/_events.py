"""Events that the trainer reports."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeAlias, TypedDict, Union

import numpy as np
from numpy.typing import NDArray


class StartedEvent(TypedDict):
    """Before the first step."""

    event: Literal["started"]
    from_step: int
    steps: int
    samples: int
    validation_samples: int
    mean_displacement_m: float
    """Of the vehicle between the frames of a pair, in metres."""


class StepEvent(TypedDict):
    """After each step."""

    event: Literal["step"]
    step: int
    """Counted from 1."""
    steps: int
    losses: dict[str, float]
    """By name, as in log.csv: means over the step's samples."""
    learning_rate: float
    images_per_second: float
    remaining_s: float
    scale_ratio: float
    """1 if the scale is metric, NaN if nothing determines it."""
    gradient_norm: float


class ValidatedEvent(TypedDict):
    """After validation on the held-out samples."""

    event: Literal["validated"]
    step: int
    losses: dict[str, float]
    selection: float
    """The value that `best` is chosen by."""
    scale_ratio: float
    best: bool
    """Whether this is the best so far."""


class SavedEvent(TypedDict):
    """After a checkpoint was written."""

    event: Literal["saved"]
    step: int
    path: Path


class PanelEvent(TypedDict):
    """A sample with its predicted disparity, for display."""

    event: Literal["panel"]
    step: int
    name: str
    image: NDArray[np.float32]
    """3 x H x W, 0 to 1."""
    disparity: NDArray[np.float32]
    """H x W."""


class CameraEvent(TypedDict):
    """At the end of a run that learns its camera."""

    event: Literal["camera"]
    step: int
    size: tuple[int, int]
    """Width and height."""
    focal_px: list[float]
    """fx and fy."""
    sigma_px: list[float] | None
    """One standard deviation of each, if the drives determine it."""


class WarningEvent(TypedDict):
    """Something looks wrong, but training continues."""

    event: Literal["warning"]
    step: int
    message: str


TrainEvent: TypeAlias = Union[StartedEvent, StepEvent, ValidatedEvent, SavedEvent, PanelEvent, CameraEvent, WarningEvent]
"""An event of the trainer: a dict whose `event["event"]` names its kind: "started", "step", "validated", "saved", "panel",
"camera" or "warning"."""
