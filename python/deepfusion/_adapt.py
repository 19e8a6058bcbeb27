"""Adapting a network to new drives."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from . import _native
from ._events import TrainEvent
from ._native import Model
from ._train import _paths, _settings


@dataclass(frozen=True)
class Adaptation:
    """The result of an adaptation. `load()` loads the adapted network, whether it was kept or not."""

    kept: bool
    """Whether no check got worse. A result that is not kept is moved aside, and the given network is the better one on these drives."""
    path: Path
    """The run folder: the `out` that was asked for, or where the result was moved (`out` + ".refused")."""
    source: str
    """The given network."""
    steps: int
    """Training steps."""
    worse: list[dict[str, Any]]
    """The checks that got worse: check, before, after."""
    before: dict[str, Any]
    """The given network on the held-out frames, without ground truth: scale_certificate, without_truth (as in `deepfusion eval --json`)."""
    after: dict[str, Any]
    """The adapted network on the same frames."""

    def load(self, **options: Any) -> Model:
        """Loads the adapted network; options as in `deepfusion.load`."""
        from . import load

        return load(self.path, **options)

    def undo(self) -> None:
        """Makes the run in `path` predict like the given network. The adapted network's files stay in it under other names."""
        _native.undo_adaptation(self.path)


def adapt(
    data: str | PathLike[str] | Sequence[str | PathLike[str]],
    model: str | PathLike[str] = "street",
    callback: Callable[[TrainEvent], bool | None] | None = None,
    *,
    out: str | PathLike[str],
    data_set: str | None = None,
    camera: Literal["2", "3", "both"] = "2",
    clock_offset_ms: float | None = None,
    steps: int = 240,
    batch: int = 3,
    simulated: int = 2,
    simulated_camera: Literal["own", "any"] = "own",
    learning_rate: float = 5e-5,
    held_out: float = 0.25,
    speed_error: float = 0.03,
    seed: int = 0,
    config: Mapping[str, Any] | None = None,
    device: str = "cpu",
) -> Adaptation:
    """Fine-tunes an existing network on drives with a speed, and keeps the result only if it is no worse.

    The end of each drive (the share `held_out`) is never trained on. There, the network is evaluated before and after, without
    ground truth: how well frames explain each other, whether depths agree from frame to frame and with the mirrored image, and the
    scale bias.

    `model` is a run, a checkpoint, or the name of an embedded network; `data_set` names one of the data sets that a run was trained
    on. Each step has `batch` samples of the drives and `simulated` samples of simulated depth, which keep the network from
    forgetting what it learned before. The simulated streets are rendered with the drives' own cameras, at the height above the road
    that their images show (`simulated_camera="own"`), or with any camera (`"any"`). `clock_offset_ms` is how far the camera's clock is
    ahead of the vehicle's, if the recordings do not state it. `speed_error` is one standard error of the speed, as a share of it.
    `config` sets any key of the configuration, as in `train`. `device` is where the network is trained and evaluated, as in `load`.

    The run goes to `out`, new or empty. `callback` gets each `TrainEvent`, on another thread than the caller's, as in `train`. If it
    returns False or raises, or at Ctrl-C, the training so far is saved, and the same call continues it.
    """
    asked = {
        "model": os.fspath(model),
        "data_set": data_set,
        "data": _paths(data),
        "out": Path(out),
        "camera": camera,
        "clock_offset_ms": clock_offset_ms,
        "steps": steps,
        "batch": batch,
        "simulated": simulated,
        "simulated_camera": simulated_camera,
        "learning_rate": learning_rate,
        "held_out": held_out,
        "speed_error": speed_error,
        "seed": seed,
        "device": device,
        "settings": list(_settings(config or {})),
    }
    outcome = json.loads(_native.adapt(asked, callback))
    outcome["path"], outcome["source"] = Path(outcome.pop("run")), outcome.pop("from")
    return Adaptation(**outcome)
