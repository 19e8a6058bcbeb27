"""Training."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from . import _native
from ._devices import own_gpu
from ._events import TrainEvent
from ._native import Model
from .distributed import Workers


@dataclass(frozen=True)
class Run:
    """A run that has ended or was stopped. `load()` loads its network."""

    path: Path
    """The folder: config.toml, checkpoints, log.csv."""
    step: int
    """Steps done."""
    steps: int
    """Steps of the whole run."""
    stopped: bool
    """Whether the callback stopped it; `train(..., out=run.path, resume=True)` continues it."""
    seconds: float
    """Wall time of this call."""
    losses: dict[str, float] | None
    """Those of the last step, as in log.csv."""
    validation: dict[str, float] | None
    """Those of the held-out samples, at the last validation."""
    best_validation: float | None
    """The lowest value so far that `best` is chosen by."""
    scale_ratio: float | None
    """Displacement by the vehicle's speed over displacement by PoseNet at the end: 1 if the scale is metric. If trained on known depth
    alone, without PoseNet, true over predicted depth. None if nothing determines it."""
    skipped_steps: int
    """Steps skipped because their gradient was not finite."""
    skipped_drives: list[str]
    """Drives that were left out, with the reasons."""

    def load(self, **options: Any) -> Model:
        """Loads the trained network; options as in `deepfusion.load`."""
        from . import load

        return load(self.path, **options)


def _toml(value: Any) -> str:
    """A value as TOML."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (str, PathLike)):
        return json.dumps(os.fspath(value), ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_toml(v)}" for key, v in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_toml, value)) + "]"
    raise TypeError(f"config: a configuration cannot contain {value!r}")


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """A table's values, each with its key, dots between tables."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _settings(table: Mapping[str, Any]) -> Iterator[str]:
    """A table's values, one `key=value` each."""
    for key, value in _flat(table):
        yield f"{key}={'none' if value is None else _toml(value)}"


def _paths(given: str | PathLike[str] | Sequence[str | PathLike[str]] | None) -> list[str]:
    if given is None:
        return []
    if isinstance(given, (str, PathLike)):
        given = [given]
    return [os.fspath(path) for path in given]


def train(
    config: str | PathLike[str] | Mapping[str, Any] | None = None,
    data: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    callback: Callable[[TrainEvent], bool | None] | None = None,
    *,
    out: str | PathLike[str] | None = None,
    init: str | PathLike[str] | None = None,
    validation: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    camera: Literal["2", "3", "both"] | None = None,
    resume: bool = False,
    workers: Workers | None = None,
    device: str = "cpu",
) -> Run:
    """Trains a network to predict metric depth, from recordings and without depth labels.

    `config` is a preset ("tiny", the default, "light", "resnet50", "paper", "monodepth2", "monodepth2-50", "lite-mono",
    "lite-mono-small", "lite-mono-tiny", "lite-mono-8m", "r-msfm3", "r-msfm6", "sfmlearner"), the path of a TOML file, or a dict over
    a preset: `{"preset": "light", "steps": 500, "loss": {"smoothness": 0.01}}` (nested tables, or keys with dots; None removes an
    optional key; docs/reference/configuration.md has all keys). `data` are recordings of any known layout. `validation` are
    recordings to validate on; without them, the end of each drive is held out. `camera` is "2", "3" or "both".

    The run goes to `out`, new or empty (by default runs/train-TIME). It starts from `init`: a run, a checkpoint, the name of an
    embedded network, or "none"; by default the embedded network with the preset's layers, if there is one. With `resume=True`, the
    run in `out` continues: `config` as a dict may then make it longer (`steps`, `epochs`), and `data` say where its recordings are
    now; anything that contradicts the run is an error.

    `workers` are several processes that train one network together, connected by `deepfusion.distributed`. Each calls `train` with
    the same arguments; `batch` and `accumulate` are those of each worker; worker 0 validates and writes the run. K workers learn the
    same as one with `accumulate` K times as large.

    `device` is where to train, as in `load`: "cpu", "auto", "cuda:1". With `workers` that torchrun, MPI or Slurm started, "cuda", and
    "auto" if that is CUDA, is each worker's own GPU. On a GPU, presets have larger sizes, and `"precision": "bf16"` is for those with
    tensor cores.

    `callback` gets each `TrainEvent`. If it returns False, training stops after the step and the run is saved. If it raises, training
    stops as well, and the exception is raised here. Ctrl-C saves the run and raises KeyboardInterrupt. The callback is called on
    another thread than the one that calls `train`, which waits. Create objects that belong to a thread (`threading.local`,
    `sqlite3` connections, windows) in the callback, or reach them through a queue.
    """
    settings: list[str] = []
    if isinstance(config, Mapping):
        table = dict(config)
        config = table.pop("preset", None)
        settings = list(_settings(table))
    if out is None:
        if workers is not None:
            raise ValueError("out: missing; workers need the folder of the run that they train")
        if resume:
            raise ValueError("out: missing; resume needs the folder of the run to continue")
        out = Path("runs") / time.strftime("train-%Y%m%d-%H%M%S", time.gmtime())
    out = Path(out)
    asked = {
        "config": config,
        "settings": settings,
        "data": _paths(data),
        "validation": _paths(validation),
        "camera": camera,
        "out": out,
        "init": init,
        "resume": resume,
        "workers": workers,
        "device": own_gpu(device, workers),
    }
    figures = _native.train(asked, callback)
    return Run(**figures)
