"""Trials of configurations, by Ray Tune."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from ray import tune as ray_tune

import deepfusion
from deepfusion._train import _flat

from ._devices import of_workers
from ._storage import start, urls


@dataclass(frozen=True)
class Trial:
    """A configuration that was tried."""

    settings: dict[str, Any]
    """What was set over `config`: keys of the configuration, with dots between tables."""
    path: Path | None
    """The run's folder, on the machine that trained it."""
    step: int | None
    """The last step that it reported."""
    selection: float | None
    """The lowest value that `best` is chosen by: a loss on held-out samples."""
    metrics: dict[str, Any]
    """Its last report: `step`, `selection`, `scale_ratio` if something determines it, and the held-out losses by their names in log.csv."""
    error: str | None
    """Why it failed; None if it did not."""
    row: str | None = None
    """Name of its row in `ablate`, otherwise None. Its seed is among the settings."""


def tune(
    space: Mapping[str, Any],
    data: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    config: str | Mapping[str, Any] = "tiny",
    out: str | PathLike[str] = "runs/tune",
    trials: int = 1,
    init: str | PathLike[str] | None = None,
    validation: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    camera: Literal["2", "3", "both"] | None = None,
    cpus_per_trial: int = 1,
    gpus_per_trial: float = 0,
    device: str | None = None,
    metric: str = "selection",
    mode: str = "min",
    scheduler: Any | None = None,
    search: Any | None = None,
) -> list[Trial]:
    """Trains one run for each draw from `space`, and returns them all, the best first.

    `space` maps keys of the configuration (with dots between tables: `"loss.smoothness"`, `"learning_rate"`) to Ray Tune's ranges
    (`ray.tune.loguniform(1e-5, 1e-3)`, `ray.tune.grid_search([...])`) or to fixed values; `trials` is the number of draws (for grids:
    of draws per grid point). `config` is a preset, or a dict over one. Each validation reports, so that a `scheduler`
    (`ASHAScheduler`) can stop trials that lag behind; `search` proposes values (Optuna's, for example). Each trial's run has a folder
    of its own below `out`, which all machines share.

    `validation` and `camera` are those of `deepfusion.train`. With `gpus_per_trial`, each trial gets a GPU, or a share of one, and
    trains on it: `device` is "auto" by default, or the backend ("cuda", "vulkan") without a number. With CUDA, it sees only the GPU
    that Ray gave it; with another backend, all trials of a machine use the one that the backend prefers.
    """
    learning = _learning(init, validation, camera, gpus_per_trial, device)
    fixed = {"preset": config} if isinstance(config, str) else dict(config)
    data = urls(data)
    folder = Path(out).absolute()

    def settings(drawn: Mapping[str, Any]) -> dict[str, Any]:
        return merged(drawn)

    return _run(settings, space, fixed, data, folder, trials, learning, (cpus_per_trial, gpus_per_trial), metric, mode, scheduler, search)


def ablate(
    rows: Mapping[str, Mapping[str, Any]],
    data: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    seeds: Sequence[int] = (1, 2, 3),
    config: str | Mapping[str, Any] = "tiny",
    out: str | PathLike[str] = "runs/ablation",
    init: str | PathLike[str] | None = None,
    validation: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    camera: Literal["2", "3", "both"] | None = None,
    cpus_per_trial: int = 1,
    gpus_per_trial: float = 0,
    device: str | None = None,
) -> dict[str, list[Trial]]:
    """Trains every row, settings over `config`, with every seed, and returns the trials by row, in the order of `seeds`.

    `{"all": {}, "no smoothness": {"loss.smoothness": 0.0}}`; otherwise like `tune`.
    """
    learning = _learning(init, validation, camera, gpus_per_trial, device)
    fixed = {"preset": config} if isinstance(config, str) else dict(config)
    named = {name: merged(row) for name, row in rows.items()}

    def settings(drawn: Mapping[str, Any]) -> dict[str, Any]:
        return merged(named[drawn["row"]], {"seed": drawn["seed"]})

    space = {"row": ray_tune.grid_search(list(named)), "seed": ray_tune.grid_search(list(seeds))}
    folder = Path(out).absolute()
    tried = _run(
        settings, space, fixed, urls(data), folder, 1, learning, (cpus_per_trial, gpus_per_trial), "selection", "min", None, None
    )
    by_seed = sorted(tried, key=lambda trial: list(seeds).index(trial.settings["seed"]))
    return {name: [trial for trial in by_seed if trial.row == name] for name in named}


def merged(*tables: Mapping[str, Any]) -> dict[str, Any]:
    """Merges settings, each by its key with dots between tables: later tables replace only the keys that they have."""
    return {key: value for table in tables for key, value in _flat(table)}


def lower(best: float | None, value: float) -> float | None:
    """The lower of two values. One that is not finite is ignored, since NaN would stay forever."""
    if not math.isfinite(value):
        return best
    return value if best is None else min(best, value)


def best_first(trials: Sequence[Trial], metric: str, mode: str) -> list[Trial]:
    """Trials sorted by their last report; those without a finite value come last."""

    def key(trial: Trial) -> tuple[bool, float]:
        value = trial.metrics.get(metric, math.nan)
        if not math.isfinite(value):
            return True, 0.0
        return False, value if mode == "min" else -value

    return sorted(trials, key=key)


def _learning(init: Any, validation: Any, camera: str | None, gpus: float, device: str | None) -> dict[str, Any]:
    """The arguments of `deepfusion.train` that all trials have, as every machine understands them."""
    if gpus < 0:
        raise ValueError(f"gpus_per_trial: expected 0 or more, found {gpus}")
    device = of_workers(device, gpus)
    if gpus and ":" in device:
        raise ValueError(f"device: expected {device.partition(':')[0]!r}, since each trial is given its own GPU, found {device!r}")
    if not gpus and device != "cpu":
        raise ValueError(f"device: {device!r} needs gpus_per_trial, which gives each trial a GPU")
    return {
        "init": start(init),
        "validation": None if validation is None else urls(validation),
        "camera": camera,
        "device": device,
    }


def _run(
    settings: Callable[[Mapping[str, Any]], dict[str, Any]],
    space: Mapping[str, Any],
    fixed: dict[str, Any],
    data: list[str],
    folder: Path,
    samples: int,
    learning: dict[str, Any],
    resources: tuple[int, float],
    metric: str,
    mode: str,
    scheduler: Any,
    search: Any,
) -> list[Trial]:
    cpus, gpus = resources

    def trial(drawn: dict[str, Any]) -> None:
        import os

        os.environ["RAYON_NUM_THREADS"] = str(cpus)
        out = folder / ray_tune.get_context().get_trial_id()
        best: float | None = None

        def report(event: deepfusion.TrainEvent) -> None:
            nonlocal best
            if event["event"] == "validated":
                best = lower(best, event["selection"])
                # A scheduler needs a number from the first report on.
                worst = math.inf if mode == "min" else -math.inf
                figures = {"step": event["step"], "selection": worst if best is None else best, "path": str(out)}
                if math.isfinite(event["scale_ratio"]):
                    figures["scale_ratio"] = event["scale_ratio"]
                ray_tune.report(figures | dict(event["losses"] or {}))

        deepfusion.train(merged(fixed, settings(drawn)), data, report, out=out, **learning)

    folder.mkdir(parents=True, exist_ok=True)
    tuner = ray_tune.Tuner(
        ray_tune.with_resources(trial, {"cpu": cpus, "gpu": gpus} if gpus else {"cpu": cpus}),
        param_space=dict(space),
        tune_config=ray_tune.TuneConfig(
            metric=metric, mode=mode, num_samples=samples, scheduler=scheduler, search_alg=search
        ),
        run_config=ray_tune.RunConfig(name="trials", storage_path=str(folder)),
    )
    tried = []
    for result in tuner.fit():
        metrics = result.metrics or {}
        ours = {key: value for key, value in metrics.items() if isinstance(value, (int, float)) and key not in _RAYS_OWN}
        drawn = result.config or {}
        selection = metrics.get("selection")
        tried.append(
            Trial(
                settings=settings(drawn),
                path=Path(metrics["path"]) if "path" in metrics else None,
                step=metrics.get("step"),
                selection=None if selection is None else lower(None, selection),
                metrics=ours,
                error=None if result.error is None else str(result.error),
                row=drawn.get("row"),
            )
        )
    return best_first(tried, metric, mode)


# What Ray Tune adds to each report.
_RAYS_OWN = {
    "timestamp",
    "done",
    "training_iteration",
    "pid",
    "time_this_iter_s",
    "time_total_s",
    "time_since_restore",
    "iterations_since_restore",
    "should_checkpoint",
    "checkpoint_dir_name",
}
