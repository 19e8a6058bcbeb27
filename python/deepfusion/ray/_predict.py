"""Bulk prediction on a cluster: every image exactly once, even if workers die."""

from __future__ import annotations

import io
import json
import logging
import os
import time
import uuid
import zlib
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
import ray
import ray.data
from ray.util import metrics

import deepfusion

from ._devices import of_workers
from ._storage import Folder, Sources, images, network, urls, weights_mark

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from deepfusion._native import _PostProcess as PostProcess
    from deepfusion._types import Precision

_LOG = logging.getLogger(__name__)

_ENDINGS = {"depth-png": "_depth.png", "npy": "_depth.npy", "sigma": "_sigma.npy", "confidence": "_confidence.npy"}

# Images that a worker takes at once: enough that reading, network and writing overlap, few enough that little must be repeated
# if a worker dies.
_BATCH = 16

# Ray's plan of a job grows with the number of blocks.
_MOST_BLOCKS = 4000


@dataclass(frozen=True)
class PredictSummary:
    """The result of a job."""

    images: int
    """Number of images among the inputs."""
    done: int
    """Predicted by this job."""
    kept: int
    """Already predicted, by an earlier job with the same network and options."""
    failed: list[tuple[str, str]]
    """Images that could not be predicted, and why. Repair them and start the same job again."""
    seconds: float
    """Wall time."""

    @property
    def images_per_second(self) -> float:
        """Of the images that this job predicted."""
        return self.done / self.seconds


@dataclass(frozen=True)
class _Job:
    """The settings that every worker gets."""

    id: str
    model: str
    precision: Precision
    data_set: str | None
    intrinsics: tuple[float, float, float, float] | None
    focal_correction: bool
    stretch: bool
    post_process: PostProcess | None
    output: str
    save: tuple[str, ...]
    overwrite: bool
    threads: int
    options: dict[str, Any]
    weights: str | None
    device: str
    gpus: float

    def made_with(self) -> dict[str, Any]:
        """What the outputs depend on apart from the image."""
        asked = asdict(self)
        named = ("precision", "data_set", "focal_correction", "stretch", "weights")
        made = {name: asked[name] for name in named}
        made["version"] = deepfusion.__version__
        # A run may be mounted at different paths, so it is identified by its weights.
        made["model"] = self.model if self.weights is None else None
        made["intrinsics"] = None if self.intrinsics is None else list(self.intrinsics)
        made["save"] = list(self.save)
        # Absent for single predictions, as in outputs of versions that had no others.
        if self.post_process is not None:
            made["post_process"] = self.post_process
        return made


class _Worker:
    """One network in one process."""

    def __init__(self, job: _Job) -> None:
        # The pool of threads reads this when it is first used, below.
        os.environ["RAYON_NUM_THREADS"] = str(job.threads)
        self.job = job
        self.made_with = job.made_with()
        self.sources = Sources(job.options)
        self.folder = Folder(job.output, job.options)
        self.refused: deepfusion.DeepFusionError | None = None
        with ExitStack() as stack:
            model = job.model
            if "://" in model:
                model = stack.enter_context(self.sources.local_tree(model))
            try:
                self.model = deepfusion.load(model, precision=job.precision, data_set=job.data_set, device=job.device)
            except deepfusion.DeepFusionError as error:
                # Raised here, it would look as if the worker had died. So it is returned to the caller.
                self.refused = error
                return
        # The backend that "auto" chose on this machine. Results of different backends differ in the last digits.
        opened = self.model.device.partition(":")[0]
        if job.gpus and opened == "cpu":
            raise RuntimeError("this worker's GPU cannot be used: no backend of the package on this machine finds it")
        if opened != "cpu":
            self.made_with["device"] = opened
        self.counted = metrics.Counter("deepfusion_images", "Images by outcome", ("outcome",))
        self.took = metrics.Histogram("deepfusion_image_seconds", "Wall time of an image", [0.01, 0.03, 0.1, 0.3, 1, 3, 10])

    def __call__(self, batch: dict[str, np.ndarray]) -> dict[str, Any]:
        rows = list(zip(map(str, batch["image"]), map(str, batch["name"])))
        if self.refused is not None:
            why = json.dumps({"message": str(self.refused), "hint": self.refused.hint})
            return {"image": [url for url, _ in rows], "outcome": ["refused"] * len(rows), "why": [why] * len(rows)}
        outcomes: dict[int, tuple[str, str]] = {}
        todo: list[tuple[int, dict[str, Any]]] = []
        for i, (url, name) in enumerate(rows):
            try:
                # Taken before the image is read, so that the next job notices a change in between.
                mark = self.sources.mark(url)
                found = self.existing(url, name, mark)
                if self.job.overwrite and found != ("done", ""):
                    found = None
            except Exception as error:  # Any error of a file system is only this image's failure.
                outcomes[i] = ("failed", _reason(error))
                continue
            if found is None:
                todo.append((i, mark))
            else:
                outcomes[i] = found
        with self.sources.local([rows[i][0] for i, _ in todo]) as paths:
            readable = [(i, mark, path) for (i, mark), path in zip(todo, paths) if isinstance(path, str)]
            outcomes |= {i: ("failed", _reason(path)) for (i, _), path in zip(todo, paths) if not isinstance(path, str)}
            predictions = self.model.predict_many(
                [path for _, _, path in readable],
                self.job.intrinsics,
                focal_correction=self.job.focal_correction,
                stretch=self.job.stretch,
                post_process=self.job.post_process,
            )
            for i, mark, _ in readable:
                begun = time.monotonic()
                try:
                    prediction = next(predictions)
                    self.write(*rows[i], mark, prediction)
                    outcomes[i] = ("done", "")
                except Exception as error:
                    outcomes[i] = ("failed", _reason(error))
                self.took.observe(time.monotonic() - begun)
        for outcome, _ in outcomes.values():
            self.counted.inc(1, {"outcome": outcome})
        ordered = [outcomes[i] for i in range(len(rows))]
        return {
            "image": [url for url, _ in rows],
            "outcome": [outcome for outcome, _ in ordered],
            "why": [why for _, why in ordered],
        }

    def existing(self, url: str, name: str, mark: dict[str, Any]) -> tuple[str, str] | None:
        """The state of an image's outputs: `done` if this job wrote them before a worker died, `kept` if an earlier job did, `failed` if
        they belong to something else, None if they are not complete."""
        written = self.folder.read(f"{name}.json")
        if written is None:
            return None
        try:
            sidecar = json.loads(written)
            files = list(zip(sidecar["files"], sidecar["file_bytes"], sidecar["file_crc32"], strict=True))
            of, when, made_with = sidecar["image"], sidecar["image_file"], sidecar["made_with"]
        except (ValueError, KeyError, TypeError):
            return "failed", f"{name}.json: not written by this function; overwrite=True replaces it"
        if of != url:
            return "failed", f"{name}.json: belongs to another image, {of}; choose another output, or overwrite=True"
        if when != mark:
            return "failed", "the image has changed since its depth was predicted; overwrite=True predicts it again"
        if made_with != self.made_with:
            differs = [key for key in {**self.made_with, **made_with} if made_with.get(key) != self.made_with.get(key)]
            return "failed", f"its depth was predicted with another {', '.join(differs)}; overwrite=True predicts it again"
        parent = name.rpartition("/")[0]
        for file, size, crc32 in files:
            file = f"{parent}/{file}" if parent else file
            if self.folder.size(file) != size:
                return None
            # An object store never keeps incomplete uploads; a disk may have zeros after a power cut.
            if not self.folder.atomic_put and f"{zlib.crc32(self.folder.read(file) or b''):08x}" != crc32:
                return None
        return ("done" if sidecar.get("job") == self.job.id else "kept"), ""

    def write(self, url: str, name: str, mark: dict[str, Any], prediction: deepfusion.Prediction) -> None:
        """Writes the outputs, then the sidecar, which marks the image as done."""
        depth = prediction.depth
        outputs = {f"{name}{_ENDINGS[kind]}": _encoded(kind, prediction) for kind in self.job.save}
        if self.job.overwrite:
            # If the job ended before the new sidecar is written, the old one would mark the new depth as its own.
            self.folder.remove(f"{name}.json")
        for file, data in outputs.items():
            self.folder.write(file, data)
        known = depth[depth > 0]
        sidecar = {
            "image": url,
            "image_file": mark,
            "size": [depth.shape[1], depth.shape[0]],
            "unit": "metres along the camera's axis (z)",
            "model": self.job.model,
            "checkpoint_step": self.model.step,
            "intrinsics": prediction.intrinsics,
            "camera_known": prediction.intrinsics is not None,
            "depth_m": [float(known.min()), float(known.max())] if known.size else None,
            "files": [file.rpartition("/")[2] for file in outputs],
            "file_bytes": [len(data) for data in outputs.values()],
            "file_crc32": [f"{zlib.crc32(data):08x}" for data in outputs.values()],
            "made_with": self.made_with,
            "job": self.job.id,
        }
        self.folder.write(f"{name}.json", json.dumps(sidecar, indent=2).encode())


def _reason(error: BaseException) -> str:
    hint = getattr(error, "hint", None)
    return f"{error}" + (f" (hint: {hint})" if hint else "") or type(error).__name__


def _encoded(kind: str, prediction: deepfusion.Prediction) -> bytes:
    if kind == "depth-png":
        return _depth_png(prediction.depth)
    array = prediction.depth if kind == "npy" else getattr(prediction, kind)
    if array is None:
        raise ValueError(f"the network does not predict uncertainty: leave out {kind} from save")
    file = io.BytesIO()
    np.save(file, np.ascontiguousarray(array))
    return file.getvalue()


def _depth_png(depth: np.ndarray) -> bytes:
    """KITTI's format: 16-bit grey, in steps of 1/256 m, 0 where there is no depth."""
    from PIL import Image

    # Half a step is rounded up, as in the program's own files.
    steps = np.clip(np.floor(depth.astype(np.float64) * 256 + 0.5), 1, 65535)
    file = io.BytesIO()
    Image.fromarray(np.where(depth > 0, steps, 0).astype(np.uint16)).save(file, "png")
    return file.getvalue()


def _check(model: str, precision: Precision, data_set: str | None, save: Sequence[str], post_process: PostProcess | None) -> None:
    """Raises the errors that every worker would: a wrong name, a run without weights. This machine may lack the workers' GPU and their
    processors' precision."""
    opened = deepfusion.load(model, data_set=data_set)
    if precision == "int8":
        # Checks the calibration, if this processor can compute in int8.
        try:
            deepfusion.load(model, precision=precision, data_set=data_set)
        except deepfusion.DeepFusionError as error:
            if "needs a processor" not in str(error):
                raise
    grey = np.full((64, 64, 3), 128, np.uint8)
    camera = (64.0, 64.0, 31.5, 31.5)
    uncertain = [kind for kind in save if kind in ("sigma", "confidence")]
    if post_process is not None:
        # Raises for a test-time augmentation that the network does not support.
        opened.predict(grey, camera, post_process=post_process)
    if uncertain and opened.predict(grey, camera).sigma is None:
        raise ValueError(f"save: the network does not predict uncertainty, so there is no {uncertain[0]} to save")


def predict(
    paths: str | PathLike[str] | Sequence[str | PathLike[str]],
    model: str | PathLike[str] = "street",
    output: str | PathLike[str] = "depth",
    *,
    intrinsics: ArrayLike | None = None,
    save: Sequence[str] = ("depth-png",),
    workers: int | None = None,
    cpus_per_worker: int = 1,
    gpus_per_worker: float = 0,
    device: str | None = None,
    precision: Precision = "f32",
    data_set: str | None = None,
    focal_correction: bool = True,
    stretch: bool = False,
    post_process: PostProcess | None = None,
    overwrite: bool = False,
    storage_options: Mapping[str, Any] | None = None,
) -> PredictSummary:
    """Predicts the depth of many images on a cluster, each exactly once.

    `paths` are images, folders (with everything below them, except `output` and earlier depth images) and globs; `output` is a
    folder. Both, and `model` unless it is an embedded network, are paths that all machines share, or URLs; `storage_options` are those
    of their file system (fsspec's). The images come from one camera: `intrinsics` are fx, fy, cx, cy in its pixels, or the 3 x 3
    matrix; without them, each file's EXIF data is used, else the training camera's lens is assumed. `save` names what to write:
    "depth-png" (`NAME_depth.png`, KITTI's 16-bit PNG), "npy" (`NAME_depth.npy`, f32 metres), "sigma" and "confidence"
    (`NAME_sigma.npy`, `NAME_confidence.npy`, for a network that predicts uncertainty). `post_process` is that of `Model.predict`,
    `precision` that of `deepfusion.load`: the workers' processors must support it, this machine's need not.

    Each of up to `workers` processes (default: as many as the cluster has room for) has one network and `cpus_per_worker` threads,
    and with `gpus_per_worker` a GPU, or a share of one (0.5: two processes on each). It then computes there: `device` is "auto" by
    default, or the backend (as in `deepfusion.load`). With CUDA, each process sees only the GPU that Ray gave it; with another
    backend, all processes of a machine use the one that the backend prefers.

    An image's `NAME.json` is written last and marks it as done: complete outputs of the same image, network and options are kept. So
    the same call resumes a stopped job. A worker that dies is replaced, and what it had not finished is done again. An image that
    cannot be read, or whose existing outputs belong to something else, is in the summary's `failed`; the others are done.
    """
    unknown = [kind for kind in save if kind not in _ENDINGS]
    if unknown or not save:
        raise ValueError(f"save: expected some of {', '.join(_ENDINGS)}, found {list(save)}")
    for name, number in [("workers", workers), ("cpus_per_worker", cpus_per_worker)]:
        if number is not None and number < 1:
            raise ValueError(f"{name}: expected at least 1, found {number}")
    if gpus_per_worker < 0:
        raise ValueError(f"gpus_per_worker: expected 0 or more, found {gpus_per_worker}")
    device = of_workers(device, gpus_per_worker)
    if gpus_per_worker and ":" in device:
        raise ValueError(f"device: expected no number, since each worker sees only the GPU it is given, found {device}")
    if precision != "f32" and (gpus_per_worker or device not in ("cpu", "auto")):
        raise ValueError(f'precision: expected "f32" on a GPU, found {precision!r}')
    if precision not in ("f32", "bf16", "int8"):
        raise ValueError(f'precision: expected "f32", "bf16" or "int8", found {precision!r}')
    options = dict(storage_options or {})
    model = network(model)
    if "://" not in model:
        _check(model, precision, data_set, save, post_process)
    camera = None
    if intrinsics is not None:
        k = np.asarray(intrinsics, dtype=float)
        if k.shape == (3, 3) and (k[0, 1], k[1, 0], *k[2]) != (0, 0, 0, 0, 1):
            raise ValueError("intrinsics: not the matrix of a pinhole camera (fx 0 cx, 0 fy cy, 0 0 1)")
        fx, fy, cx, cy = map(float, (k[0, 0], k[1, 1], k[0, 2], k[1, 2]) if k.shape == (3, 3) else k)
        camera = (fx, fy, cx, cy)
    job = _Job(
        id=uuid.uuid4().hex,
        model=model,
        precision=precision,
        data_set=data_set,
        intrinsics=camera,
        focal_correction=focal_correction,
        stretch=stretch,
        post_process=post_process,
        output=urls(output)[0],
        save=tuple(dict.fromkeys(save)),
        overwrite=overwrite,
        threads=cpus_per_worker,
        options=options,
        weights=weights_mark(model, options),
        device=device,
        gpus=gpus_per_worker,
    )
    named = images(urls(paths), options)
    if not ray.is_initialized():
        ray.init()
    if workers is None:
        there = ray.cluster_resources()
        room = int(there.get("CPU", 1)) // cpus_per_worker
        if gpus_per_worker:
            room = min(room, int(there.get("GPU", 0) / gpus_per_worker))
        workers = max(1, room)
    blocks = min(-(-len(named) // _BATCH), _MOST_BLOCKS)
    begun = time.monotonic()
    rows = ray.data.from_items([{"image": url, "name": name} for url, name in named], override_num_blocks=blocks)
    outcomes = rows.map_batches(
        _Worker,
        fn_constructor_args=(job,),
        batch_size=_BATCH,
        compute=ray.data.ActorPoolStrategy(min_size=1, max_size=min(workers, blocks)),
        num_cpus=cpus_per_worker,
        num_gpus=gpus_per_worker or None,
    )
    counts = {"done": 0, "kept": 0, "failed": 0}
    failed = []
    refused = None
    for row in outcomes.iter_rows():
        if row["outcome"] == "refused":
            refused = json.loads(row["why"])
            break
        counts[row["outcome"]] += 1
        if row["outcome"] == "failed":
            failed.append((row["image"], row["why"]))
            _LOG.warning("%s: %s", row["image"], row["why"])
    if refused is not None:
        error = deepfusion.DeepFusionError(refused["message"])
        error.hint = refused["hint"]
        raise error
    seconds = time.monotonic() - begun
    return PredictSummary(len(named), counts["done"], counts["kept"], sorted(failed), seconds)
