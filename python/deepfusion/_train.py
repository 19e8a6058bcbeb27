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
    """A run that has ended, or was stopped. `load()` gives its network."""

    path: Path
    """The folder: config.toml, checkpoints, log.csv."""
    step: int
    """Steps done."""
    steps: int
    """Steps of the whole run."""
    stopped: bool
    """Whether the callback ended it; `train(..., out=run.path, resume=True)` goes on."""
    seconds: float
    """Wall time of this call."""
    losses: dict[str, float] | None
    """The last step's, as in log.csv."""
    validation: dict[str, float] | None
    """Those of the held-out samples, when they were last looked at."""
    best_validation: float | None
    """The lowest value that `best` is chosen by."""
    scale_ratio: float | None
    """Displacement by the vehicle's speed over displacement by PoseNet at the end: 1 where the scale is metric. Of known depth alone and without
    PoseNet, true over predicted depth; None where nothing says it."""
    skipped_steps: int
    """Steps skipped for a gradient that was not finite."""
    skipped_drives: list[str]
    """Drives that were left out, with the reason."""

    def load(self, **options: Any) -> Model:
        """The trained network; options as `deepfusion.load`."""
        from . import load

        return load(self.path, **options)


def _toml(value: Any) -> str:
    """As TOML writes a value."""
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
    raise TypeError(f"config: {value!r} is nothing that a configuration can hold")


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
    """Learns metric depth from recordings, without depth labels.

    `config` is a preset ("tiny", the default, "light", "resnet50", "paper", "monodepth2", "monodepth2-50", "lite-mono", "lite-mono-small", "lite-mono-tiny",
    "lite-mono-8m", "r-msfm3", "r-msfm6", "sfmlearner"), the path of a TOML file, or a dict over a preset:
    `{"preset": "light", "steps": 500, "loss": {"smoothness": 0.01}}` (tables in tables or dots in keys; None takes an optional key
    away; the keys are those of docs/reference/configuration.md). `data` are recordings of any known layout, and `validation` some to
    validate on, else the end of each drive is held out; `camera` is "2", "3" or "both".

    The run goes to `out`, new or empty (by default runs/train-TIME), and starts from `init`: a run, a checkpoint, the name of an
    embedded network or "none"; by default the embedded network that is built as the preset is, if there is one. With `resume=True` the
    run in `out` goes on: `config` as a dict may then make it longer (`steps`, `epochs`), and `data` say where its recordings are now; what
    contradicts the run is an error.

    `workers` are several processes that learn one network together, as `deepfusion.distributed` connects them: each calls `train` with
    the same arguments, `batch` and `accumulate` are each one's own, and worker 0 validates and writes the run. K workers learn what one
    learns with `accumulate` K times as large.

    `device` is where it learns, as in `load`: "cpu", "auto", "cuda:1". With `workers` that torchrun, MPI or Slurm started, "cuda", and "auto" where
    that is CUDA, is each one's own GPU. On a GPU a preset has larger sizes, and `"precision": "bf16"` is for
    those with tensor cores.

    `callback` gets each `TrainEvent`; where it returns False, training stops after the step and the run is saved. What it raises
    stops it as well, and is raised here. Ctrl-C saves the run and raises KeyboardInterrupt. It is called on another thread than the one that
    calls `train`, which waits meanwhile: what belongs to a thread (`threading.local`, connections of `sqlite3`, windows) is to be made in it, or
    reached by a queue.
    """
    settings: list[str] = []
    if isinstance(config, Mapping):
        table = dict(config)
        config = table.pop("preset", None)
        settings = list(_settings(table))
    if out is None:
        if workers is not None:
            raise ValueError("workers: out is the run that all of them learn")
        if resume:
            raise ValueError("resume: out is the run that goes on")
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
