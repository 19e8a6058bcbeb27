"""One network trained by several workers, by Ray Train."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shutil
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import deepfusion

from ._devices import numbered, of_workers
from ._storage import start, urls

_LAST, _BEST = "last.safetensors", "best.safetensors"
"""A run's checkpoints."""
_FIGURES = "ray-train.json"
"""Name of the file with the results in the run's folder."""

_ASIDE = r"\.\d+-[0-9a-f]{16}\.partial"
"""Ending of the name of a temporary file, which begins with a dot."""
_BEGUN = re.compile(
    rf"config\.toml|log\.csv|events\.out\.tfevents\..*\.deepfusion\..*|\.(config\.toml|log\.csv|(last|best)\.safetensors){_ASIDE}"
)
"""The files of a run before its first checkpoint."""
_PANEL = re.compile(rf"\d+\.png|\.\d+\.png{_ASIDE}")
"""The files in its folder `panels`."""


def train(
    config: str | Mapping[str, Any],
    data: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    out: str | PathLike[str],
    workers: int = 2,
    cpus_per_worker: int = 1,
    use_gpu: bool = False,
    device: str | None = None,
    backend: str = "gloo",
    restarts: int = 3,
    init: str | PathLike[str] | None = None,
    validation: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    camera: str | None = None,
) -> deepfusion.Run:
    """Trains one network with several workers, each with `config`'s own `batch` and `accumulate`, as in `deepfusion.distributed`.

    Needs torch, whose process group adds the gradients: `backend` is "gloo", or "nccl" between GPUs, with a torch that has CUDA.
    `out` is a folder that all machines share, new or empty. A run that exists there continues with its own configuration, or starts
    again if it has no checkpoint yet. If a worker dies, Ray starts all of them again, at most `restarts` times, and they continue
    from the last checkpoint (`checkpoint_minutes`, `validate_every`).

    With `use_gpu`, each worker gets a GPU and trains on it: `device` is "auto" by default, or the backend ("cuda", "vulkan") without
    a number, because Ray assigns a machine's GPUs. CUDA sees only the GPUs that Ray gives; the other backends count
    all of a machine's GPUs, so that two jobs on one machine would share them.
    """
    if backend not in ("gloo", "nccl"):
        raise ValueError(f'backend: expected "gloo" or "nccl", found {backend!r}')
    if backend == "nccl" and not use_gpu:
        raise ValueError('backend: "nccl" works only on GPUs; set use_gpu=True, or use "gloo"')
    device = of_workers(device, int(use_gpu))
    if ":" in device:
        raise ValueError(f"device: expected {device.partition(':')[0]!r}, since Ray assigns the GPUs, found {device!r}")
    if device != "cpu" and not use_gpu:
        raise ValueError(f"device: {device!r} needs use_gpu=True, which gives each worker a GPU")
    folder = Path(out).absolute()
    # Checked here, so that it is one immediate error and not one in each worker.
    if not (folder / _LAST).exists():
        _check_begun(folder)
    from ray.train import FailureConfig, RunConfig, ScalingConfig
    from ray.train.torch import TorchConfig, TorchTrainer

    folder.parent.mkdir(parents=True, exist_ok=True)
    arguments = {
        "config": config if isinstance(config, str) else dict(config),
        "data": urls(data),
        "out": str(folder),
        "init": start(init),
        "validation": None if validation is None else urls(validation),
        "camera": camera,
        "threads": cpus_per_worker,
        "device": device,
        "backend": backend,
    }
    trainer = TorchTrainer(
        _learn,
        train_loop_config=arguments,
        torch_config=TorchConfig(backend=backend),
        scaling_config=ScalingConfig(num_workers=workers, use_gpu=use_gpu, resources_per_worker={"CPU": cpus_per_worker}),
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

    device = arguments.pop("device")
    if device != "cpu":
        gpu = _own_gpu()
        device = numbered(device, gpu)
        if arguments["backend"] == "nccl":
            import torch

            # The GPU on which `Torch` sums gradients: each worker's own.
            torch.cuda.set_device(gpu)
    del arguments["backend"]
    out = Path(arguments.pop("out"))
    leads = ray_train.get_context().get_world_rank() == 0
    if (out / _LAST).exists():
        run = deepfusion.train({}, out=out, resume=True, workers=Torch(), device=device)
    else:
        config, data = arguments.pop("config"), arguments.pop("data")
        if leads:
            # A run that died before its first checkpoint contains nothing to keep. The best checkpoint is written before the last
            # one: if it exists, it belongs to this job, which started without any.
            _check_begun(out, _BEST)
            for file in list(out.iterdir()) if out.exists() else []:
                if file.is_dir():
                    shutil.rmtree(file)
                else:
                    file.unlink()
        run = deepfusion.train(config, data, out=out, workers=Torch(), device=device, **arguments)
    if leads:
        # Ray keeps metrics only with its own checkpoints.
        part = out / f"{_FIGURES}.part"
        part.write_text(json.dumps(dataclasses.asdict(run) | {"path": str(run.path)}))
        part.replace(out / _FIGURES)


def _check_begun(out: Path, *more: str) -> None:
    """Raises unless a folder without a last checkpoint has only files of a run that died before its first one, and `more`."""
    if not out.exists():
        return
    for file in out.iterdir():
        if file.name == "panels" and file.is_dir():
            strange = next((one for one in file.iterdir() if not _PANEL.fullmatch(one.name)), None)
        else:
            strange = None if file.name in more or _is_begun(file) else file
        if strange is not None:
            error = deepfusion.DeepFusionError(f"{out}: is not empty, and {strange.relative_to(out)} does not belong to a run that has just started")
            error.hint = "choose another folder, or empty this one first"
            raise error


def _is_begun(file: Path) -> bool:
    """Whether a file was written by a run before its first checkpoint, and does not just have such a name."""
    if not _BEGUN.fullmatch(file.name):
        return False
    if file.name == "config.toml":
        # Only a run itself writes its findings.
        return "[findings" in file.read_text(errors="replace")
    return file.name != "log.csv" or file.read_text(errors="replace").startswith("step,split,")


def _own_gpu() -> int:
    """The number of this worker's GPU among those that it sees: Ray shows each worker the GPUs of all workers of its machine."""
    from ray import train as ray_train
    from ray.train.torch import get_device

    own = get_device()
    if own.type == "cuda":
        return own.index or 0
    # A torch without CUDA does not know the GPUs; use the worker's number on its machine.
    return ray_train.get_context().get_local_rank()
