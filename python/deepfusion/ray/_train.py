"""One network learned by several workers, by Ray Train."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import deepfusion

from ._storage import urls


_FIGURES = "ray-train.json"
"""What the run came to, in its folder."""


def train(
    config: str | Mapping[str, Any],
    data: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    out: str | PathLike[str],
    workers: int = 2,
    cpus_per_worker: int = 1,
    restarts: int = 3,
    init: str | PathLike[str] | None = None,
    validation: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    camera: str | None = None,
) -> deepfusion.Run:
    """Learns one network with several workers, each with `config`'s own `batch` and `accumulate`, as `deepfusion.distributed` has it.

    Needs torch, whose process group (gloo) adds the gradients. `out` is a folder that all machines see; a run that is there goes on
    with its own configuration. Where a worker dies Ray starts all of them again, at most `restarts` times, and they go on from the last
    checkpoint (`checkpoint_minutes`, `validate_every`). The package trains on
    processors: no GPU is asked for.
    """
    from ray.train import FailureConfig, RunConfig, ScalingConfig
    from ray.train.torch import TorchConfig, TorchTrainer

    folder = Path(out).absolute()
    folder.parent.mkdir(parents=True, exist_ok=True)
    arguments = {
        "config": config if isinstance(config, str) else dict(config),
        "data": urls(data),
        "out": str(folder),
        "init": init if init is None or str(init) in {*deepfusion.networks(), "none"} else urls(init)[0],
        "validation": None if validation is None else urls(validation),
        "camera": camera,
        "threads": cpus_per_worker,
    }
    trainer = TorchTrainer(
        _learn,
        train_loop_config=arguments,
        torch_config=TorchConfig(backend="gloo"),
        scaling_config=ScalingConfig(num_workers=workers, resources_per_worker={"CPU": cpus_per_worker}),
        run_config=RunConfig(
            name=f"{folder.name}.ray", storage_path=str(folder.parent), failure_config=FailureConfig(max_failures=restarts)
        ),
    )
    result = trainer.fit()
    if result.error is not None:
        raise result.error
    figures = json.loads((folder / _FIGURES).read_text())
    return deepfusion.Run(**(figures | {"path": folder}))


def _learn(arguments: dict[str, Any]) -> None:
    """What each worker does."""
    from ray import train as ray_train

    os.environ["RAYON_NUM_THREADS"] = str(arguments.pop("threads"))
    from deepfusion.distributed import Torch

    out = Path(arguments.pop("out"))
    leads = ray_train.get_context().get_world_rank() == 0
    if (out / "last.safetensors").exists():
        run = deepfusion.train({}, out=out, resume=True, workers=Torch())
    else:
        config, data = arguments.pop("config"), arguments.pop("data")
        # Of a run that died before its first checkpoint nothing is lost.
        if leads and (out / "config.toml").exists():
            (out / "config.toml").unlink()
            (out / "log.csv").unlink(missing_ok=True)
        run = deepfusion.train(config, data, out=out, workers=Torch(), **arguments)
    if leads:
        # Ray keeps metrics only beside checkpoints of its own.
        part = out / f"{_FIGURES}.part"
        part.write_text(json.dumps(dataclasses.asdict(run) | {"path": str(run.path)}))
        part.replace(out / _FIGURES)
