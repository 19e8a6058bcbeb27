"""Checks and inspects a fleet's recordings, with one task per recording."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any

import ray
from ray.exceptions import RayError

import deepfusion

from ._storage import Sources, urls

Row = dict[str, Any]


def doctor(
    recordings: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    workers: int | None = None,
    storage_options: Mapping[str, Any] | None = None,
) -> list[Row]:
    """What `deepfusion doctor` finds in each recording: `recording`, `drives`, `frames`, `errors`, `warnings`, `findings` (their
    messages), `report` (the whole JSON) and `failed` (why it could not be checked, else None), in the order given.

    Recordings can have any known layout. Those on other file systems are fetched by the machine that checks them, together with the
    small files beside them that they need: a KITTI date's `calib_*.txt` and `dataset.toml`, `drive.toml` of `drive.mp4`,
    `calibration.yaml`. Files that `dataset.toml` names elsewhere are not fetched: pass the folder then. At most `workers` recordings
    are checked at once (default: one per core of the cluster).
    """
    return _each(_doctor, recordings, workers, storage_options)


def inspect(
    recordings: str | PathLike[str] | Sequence[str | PathLike[str]],
    *,
    workers: int | None = None,
    storage_options: Mapping[str, Any] | None = None,
) -> list[Row]:
    """What `deepfusion data inspect` reports about each recording: `recording`, `layout`, `drives`, `frames`, `usable_pairs`, `distance_m`,
    `duration_s`, `report` (the whole JSON) and `failed`. Otherwise like `doctor`."""
    return _each(_inspect, recordings, workers, storage_options)


def table(rows: Sequence[Row]) -> str:
    """Rows as a readable table: one line per recording, with sums in the last line. Long fields (`report`, `findings`) are left out."""
    if not rows:
        return "no recordings"
    columns = [key for key in rows[0] if key not in {"report", "findings"}]
    if not any(row.get("failed") for row in rows):
        columns.remove("failed")
    lines = [columns] + [[_cell(row.get(key)) for key in columns] for row in rows]
    sums = ["in all"]
    for key in columns[1:]:
        numbers = [row[key] for row in rows if isinstance(row.get(key), (int, float))]
        sums.append(_cell(sum(numbers)) if numbers else "")
    lines.append(sums)
    widths = [max(len(line[i]) for line in lines) for i in range(len(columns))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in lines)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.1f}" if isinstance(value, float) else str(value).partition("\n")[0]


def _doctor(path: str) -> Row:
    report = deepfusion.doctor(path)
    findings = [f"{one['finding']['check']}: {one['finding']['what']}" for one in report["findings"]]
    return {
        "drives": len(report["drives"]),
        "frames": sum(drive["frames"] for drive in report["drives"]),
        "errors": report["errors"],
        "warnings": report["warnings"],
        "findings": findings,
        "report": report,
    }


def _inspect(path: str) -> Row:
    command = [sys.executable, "-m", "deepfusion", "data", "inspect", path, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise deepfusion.DeepFusionError(done.stderr.strip())
    report = json.loads(done.stdout)
    return {
        "layout": report["kind"],
        "drives": len(report.get("drives", [])),
        "frames": report["frames"],
        "usable_pairs": sum(drive["usable_pairs"] or 0 for drive in report.get("drives", [])),
        "distance_m": report.get("distance_m"),
        "duration_s": report.get("duration_s"),
        "report": report,
    }


_EMPTY: dict[Callable[[str], Row], Row] = {
    _doctor: {"drives": None, "frames": None, "errors": None, "warnings": None, "findings": [], "report": None},
    _inspect: dict.fromkeys(["layout", "drives", "frames", "usable_pairs", "distance_m", "duration_s", "report"]),
}


def _look(look: Callable[[str], Row], url: str, options: dict[str, Any]) -> Row:
    # One core, as the task requests. The pool of threads reads this when it is first used, below.
    os.environ["RAYON_NUM_THREADS"] = "1"
    try:
        with Sources(options).local_recording(url) as path:
            return {"recording": url, **look(path), "failed": None}
    except Exception as error:  # File systems raise their own errors, which must not affect the other recordings.
        return _failed(look, url, error)


def _failed(look: Callable[[str], Row], url: str, error: Exception) -> Row:
    return {"recording": url, **_EMPTY[look], "failed": str(error) or type(error).__name__}


def _each(
    look: Callable[[str], Row],
    recordings: str | PathLike[str] | Sequence[str | PathLike[str]],
    workers: int | None,
    options: Mapping[str, Any] | None,
) -> list[Row]:
    if workers is not None and workers < 1:
        raise ValueError(f"workers: expected at least 1, found {workers}")
    if not ray.is_initialized():
        ray.init()
    task = ray.remote(num_cpus=1, max_retries=3)(_look)
    given = urls(recordings)
    rows: dict[int, Row] = {}
    running: dict[Any, int] = {}

    def ended() -> Iterator[None]:
        done, _ = ray.wait(list(running))
        for one in done:
            i = running.pop(one)
            try:
                rows[i] = ray.get(one)
            except RayError as error:  # Its process died at each attempt.
                rows[i] = _failed(look, given[i], error)
            yield

    most = workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
    for i, url in enumerate(given):
        if len(running) >= most:
            list(ended())
        running[task.remote(look, url, dict(options or {}))] = i
    while running:
        list(ended())
    return [rows[i] for i in range(len(given))]
