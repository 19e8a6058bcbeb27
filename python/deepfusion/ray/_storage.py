"""Files on any file system that fsspec knows, written completely or not at all."""

from __future__ import annotations

import json
import os
import tempfile
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from fnmatch import fnmatch
from os import PathLike
from pathlib import PurePath, PurePosixPath
from typing import Any

import fsspec

import deepfusion

# Stores where an upload appears completely or not at all, and where a rename would be a copy.
_OBJECT_STORES = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oss", "memory"}

_IMAGES = {".png", ".jpg", ".jpeg"}

# Files that a recording's reader looks for in the folder above it, or beside a video or a bag.
_BESIDE = ["calib_*.txt", "dataset.toml", "bag.toml", "speed.csv", "imu.csv", "course.csv", "frames.csv", "timestamps.txt", "times.txt",
           "calibration.*", "camera.y*ml", "camchain.y*ml", "intrinsics.txt", "camera-intrinsics.txt"]  # fmt: skip

# Logs and settings are smaller than this, other recordings mostly larger.
_MOST_BESIDE = 64 << 20


def is_local(fs: Any) -> bool:
    """Whether a file system is the machine's own file tree (mounts included)."""
    return "file" in _protocols(fs)


def _protocols(fs: Any) -> set[str]:
    named = fs.protocol
    return {named} if isinstance(named, str) else set(named)


class Folder:
    """A folder of outputs, made when the first file is written."""

    def __init__(self, url: str, options: Mapping[str, Any]) -> None:
        self.fs, self.root = fsspec.core.url_to_fs(url, **options)
        self.atomic_put = not _OBJECT_STORES.isdisjoint(_protocols(self.fs))
        self.made: set[str] = set()

    def path(self, name: str) -> str:
        return f"{self.root.rstrip('/')}/{name}"

    def read(self, name: str) -> bytes | None:
        """The file's contents; None if there is none."""
        try:
            return self.fs.cat_file(self.path(name))
        except FileNotFoundError:
            return None

    def size(self, name: str) -> int | None:
        try:
            return self.fs.info(self.path(name))["size"]
        except FileNotFoundError:
            return None

    def remove(self, name: str) -> None:
        """Removes the file, if it exists."""
        try:
            self.fs.rm_file(self.path(name))
        except FileNotFoundError:
            pass

    def write(self, name: str, data: bytes) -> None:
        """Writes the file so that a reader, or the next run after a power cut, finds all of it or none."""
        path = self.path(name)
        parent = path.rpartition("/")[0]
        if self.atomic_put:
            self.fs.pipe_file(path, data)
            return
        if parent not in self.made:
            self.fs.makedirs(parent, exist_ok=True)
            self.made.add(parent)
        # Unique to this writer: if Ray takes a living worker for dead, two may work on the same image.
        temporary = f"{path}.{uuid.uuid4().hex}.tmp"
        try:
            if is_local(self.fs):
                with open(temporary, "wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(temporary, path)
            else:
                self.fs.pipe_file(temporary, data)
                self.fs.mv(temporary, path)
        except BaseException:
            if self.fs.exists(temporary):
                self.fs.rm_file(temporary)
            raise


class Sources:
    """Reads inputs from any file system."""

    def __init__(self, options: Mapping[str, Any]) -> None:
        self.options = options

    def mark(self, url: str) -> dict[str, Any]:
        """Size and version of a file, to notice that it changed."""
        fs, path = fsspec.core.url_to_fs(url, **self.options)
        info = fs.info(path)
        if is_local(fs):
            return {"bytes": info["size"], "modified_ns": os.stat(path).st_mtime_ns}
        version = next((info[key] for key in ("ETag", "etag", "md5Hash", "LastModified", "mtime", "created") if key in info), None)
        return {"bytes": info["size"], "version": None if version is None else str(version)}

    @contextmanager
    def local(self, urls: Sequence[str]) -> Iterator[list[str | Exception]]:
        """Paths on this machine with the files' contents, in their order, for as long as the block lasts; instead of a path, why the
        file cannot be read."""
        with tempfile.TemporaryDirectory(prefix="deepfusion-") as folder:
            paths: list[str | Exception] = []
            for i, url in enumerate(urls):
                try:
                    fs, path = fsspec.core.url_to_fs(url, **self.options)
                    if is_local(fs):
                        paths.append(path)
                        continue
                    here = os.path.join(folder, f"{i}{PurePosixPath(path).suffix}")
                    fs.get_file(path, here)
                    paths.append(here)
                except Exception as error:  # File systems raise their own errors, which must not affect the other images.
                    paths.append(error)
            yield paths

    @contextmanager
    def local_tree(self, url: str) -> Iterator[str]:
        """A path on this machine with the contents of the file or folder, for as long as the block lasts."""
        fs, path = fsspec.core.url_to_fs(url, **self.options)
        if is_local(fs):
            yield path
            return
        with tempfile.TemporaryDirectory(prefix="deepfusion-") as folder:
            here = os.path.join(folder, PurePosixPath(path.rstrip("/")).name)
            fs.get(path, here, recursive=True)
            yield here

    @contextmanager
    def local_recording(self, url: str) -> Iterator[str]:
        """Like `local_tree`, together with the files that belong to a recording and are beside it: files of its name without the ending
        (`drive.toml` of `drive.mp4`, or of the folder `drive`), and those of the names that are looked for there (a KITTI date's
        `calib_*.txt`, `dataset.toml`, `calibration.yaml` …), each below 64 MB. Other files that `dataset.toml` names are not fetched:
        pass the folder then."""
        fs, path = fsspec.core.url_to_fs(url, **self.options)
        if is_local(fs):
            yield path
            return
        path = path.rstrip("/")
        above, _, name = path.rpartition("/")
        with tempfile.TemporaryDirectory(prefix="deepfusion-") as folder:
            # In a folder of the same name, which for a KITTI drive is the date.
            parent = os.path.join(folder, PurePosixPath(above).name)
            os.makedirs(parent, exist_ok=True)
            fs.get(path, os.path.join(parent, name), recursive=True)
            # Without a parent there is only the list of buckets, which is not a folder.
            for one in _files(fs, above) if above.strip("/") else []:
                beside = PurePosixPath(one["name"])
                belongs = beside.stem in (name, PurePosixPath(name).stem) or any(fnmatch(beside.name, shape) for shape in _BESIDE)
                if belongs and beside.name != name and (one["size"] or 0) < _MOST_BESIDE:
                    fs.get_file(one["name"], os.path.join(parent, beside.name))
            yield os.path.join(parent, name)


def _files(fs: Any, folder: str) -> list[dict[str, Any]]:
    """The files of a folder; none if it cannot be listed. Files with known names can be fetched without a listing."""
    if not _protocols(fs).isdisjoint({"http", "https"}):
        return []
    # A cached listing may be older than a repair of the recording.
    fs.invalidate_cache()
    try:
        return [one for one in fs.ls(folder, detail=True) if one["type"] == "file"]
    except (FileNotFoundError, NotImplementedError, PermissionError):
        return []


def urls(given: str | PathLike[str] | Sequence[str | PathLike[str]]) -> list[str]:
    """Makes paths absolute, because a worker has another working directory."""
    if isinstance(given, (str, PathLike)):
        given = [given]
    found = []
    for one in given:
        one = os.fspath(one)
        found.append(one if "://" in one else os.path.abspath(one))
    return found


def network(given: str | PathLike[str]) -> str:
    """A network as every worker finds it: the name of an embedded one, a URL, or an absolute path. A folder with an embedded network's
    name takes precedence if it contains a run, even an incomplete one, as in `deepfusion.load`."""
    given = os.fspath(given)
    if given.rstrip("/") in deepfusion.networks() and not _holds_a_run(given):
        return given.rstrip("/")
    return urls(given)[0]


def start(init: str | PathLike[str] | None) -> str | None:
    """What training starts from, as every worker finds it."""
    if init is None or os.fspath(init) == "none":
        return None if init is None else "none"
    return network(init)


def _holds_a_run(folder: str) -> bool:
    try:
        return any(name == "config.toml" or PurePath(name).suffix == ".safetensors" for name in os.listdir(folder))
    except OSError:
        return False


def images(given: Sequence[str], options: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Every image that files, folders (with everything below them) and globs name, once, with the name of its outputs: the path below
    the folder or the glob's fixed part, without its ending. If two would have the same name, the second gets `-2`. Depth images
    in a folder or glob are left out if the sidecar of their image lists them: an earlier job wrote those."""
    found: dict[str, str] = {}
    for url in given:
        fs, path = fsspec.core.url_to_fs(url, **options)
        if any(sign in path for sign in "*?["):
            fixed = path[: min(path.index(sign) for sign in "*?[" if sign in path)].rpartition("/")[0]
            below, paths = fixed, fs.glob(path)
        elif fs.isdir(path):
            below, paths = path.rstrip("/"), fs.find(path)
        elif fs.exists(path):
            below, paths = path.rpartition("/")[0], [path]
        else:
            raise FileNotFoundError(f"{url}: no such file or folder")
        named_itself = paths == [path]
        taken = [one for one in paths if PurePosixPath(one).suffix.lower() in _IMAGES and (named_itself or not _is_output(fs, one))]
        if not taken:
            raise FileNotFoundError(f"{url}: contains no image (.png, .jpg or .jpeg)")
        for one in taken:
            whole = one if is_local(fs) else fs.unstrip_protocol(one)
            found.setdefault(whole, one[len(below) :].lstrip("/"))
    named: list[tuple[str, str]] = []
    used: set[str] = set()
    # In order of paths, so that the same inputs always get the same names.
    for url, relative in sorted(found.items()):
        stem = str(PurePosixPath(relative).with_suffix(""))
        name, number = stem, 1
        while name in used:
            number += 1
            name = f"{stem}-{number}"
        used.add(name)
        named.append((url, name))
    return named


def _is_output(fs: Any, path: str) -> bool:
    """Whether this is a depth image that the sidecar beside it lists as an output. Predicting its depth would make no sense."""
    folder, _, file = path.rpartition("/")
    if not file.endswith("_depth.png"):
        return False
    try:
        return file in json.loads(fs.cat_file(f"{folder}/{file.removesuffix('_depth.png')}.json"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return False


def weights_mark(model: str, options: Mapping[str, Any]) -> str | None:
    """SHA-256 over the configuration and weights of the run that `network` found; None for an embedded network, which the program's
    version identifies."""
    import hashlib

    if model in deepfusion.networks():
        return None
    fs, path = fsspec.core.url_to_fs(model, **options)
    files = [one for one in sorted(fs.find(path)) if one.endswith((".toml", ".safetensors"))] if fs.isdir(path) else [path]
    whole = hashlib.sha256()
    for one in files:
        data = fs.cat_file(one)
        whole.update(f"{PurePosixPath(one).name}\0{len(data)}\0".encode())
        whole.update(data)
    return whole.hexdigest()
