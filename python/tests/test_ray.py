"""The package on a Ray cluster: one machine with two workers."""

import io
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import deepfusion
import numpy as np
import pytest
from PIL import Image

ray = pytest.importorskip("ray")
pytest.importorskip("ray.data")

import deepfusion.ray as cluster  # noqa: E402
import fsspec  # noqa: E402
from deepfusion.ray import _fleet, _predict, _storage, _train, _tune  # noqa: E402


@pytest.fixture(scope="module", autouse=True)
def two_cores():
    # A test needs no telemetry and no dashboard.
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="warning")
    yield
    ray.shutdown()


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """Six images, in two folders."""
    out = tmp_path_factory.mktemp("street")
    drive = deepfusion.simulate(out, frames=3, seed=5, size=(192, 64), scan_every=0)
    images = tmp_path_factory.mktemp("images")
    for i, frame in enumerate(deepfusion.Dataset(drive)):
        for side, pixels in [("left", frame.image), ("mirrored", frame.image[:, ::-1])]:
            (images / side).mkdir(exist_ok=True)
            Image.fromarray(np.ascontiguousarray(pixels)).save(images / side / f"{i}.png")
    return images


CAMERA = (140.0, 140.0, 96.0, 32.0)


def test_outputs_are_not_inputs(street, tmp_path):
    """In a folder that is searched completely and also contains the outputs."""
    images = tmp_path / "images"
    shutil.copytree(street, images)
    for out in [images / "depth", images]:
        for done, kept in [(6, 0), (0, 6)]:
            summary = cluster.predict(images, "tiny", out, intrinsics=CAMERA, workers=2)
            assert (summary.images, summary.done, summary.kept, summary.failed) == (6, done, kept, [])
    # A picture of depth that no sidecar lists is an ordinary image.
    Image.new("RGB", (8, 8)).save(images / "a_depth.png")
    (images / "a.json").write_text("{}")
    assert len(_storage.images([str(images)], {})) == 7
    assert len(_storage.images([str(images / "left")], {})) == 3


def test_each_image_once_and_as_the_command_does_it(street, tmp_path):
    out = tmp_path / "out"
    job = dict(intrinsics=CAMERA, save=("depth-png", "npy"), workers=2)
    summary = cluster.predict(street, "tiny", out, **job)
    assert (summary.images, summary.done, summary.kept, summary.failed) == (6, 6, 0, [])
    model = deepfusion.load("tiny")
    for side in ["left", "mirrored"]:
        commands = tmp_path / side
        words = ["predict", str(street / side), "--model", "tiny", "--out", str(commands), "--save", "depth-png,npy"]
        camera = ",".join(map(str, CAMERA))
        subprocess.run([sys.executable, "-m", "deepfusion", *words, "--intrinsics", camera], check=True)
        for i in range(3):
            expected = model.predict(street / side / f"{i}.png", CAMERA)
            depth = np.load(out / side / f"{i}_depth.npy")
            assert np.array_equal(depth, expected.depth)
            assert np.array_equal(depth, np.load(commands / f"{i}_depth.npy").reshape(depth.shape))
            ours, theirs = (np.asarray(Image.open(at / f"{i}_depth.png")) for at in (out / side, commands))
            assert ours.dtype == theirs.dtype and np.array_equal(ours, theirs)
    sidecar = json.loads((out / "left" / "0.json").read_text())
    assert sidecar["files"] == ["0_depth.png", "0_depth.npy"]
    assert sidecar["intrinsics"] == list(CAMERA) and sidecar["size"] == [192, 64]
    assert not list(out.rglob("*.tmp"))

    # A second time, nothing is predicted; after truncating a file, only its image is.
    written = {file: file.stat().st_mtime_ns for file in out.rglob("*.*")}
    again = cluster.predict(street, "tiny", out, **job)
    assert (again.done, again.kept) == (0, 6)
    assert written == {file: file.stat().st_mtime_ns for file in out.rglob("*.*")}
    (out / "left" / "1_depth.npy").write_bytes(bytes(len((out / "left" / "1_depth.npy").read_bytes())))
    os.truncate(out / "mirrored" / "2_depth.png", 40)
    repaired = cluster.predict(street, "tiny", out, **job)
    assert (repaired.done, repaired.kept) == (2, 4)
    assert np.array_equal(np.load(out / "left" / "1_depth.npy"), model.predict(street / "left" / "1.png", CAMERA).depth)

    # Outputs of another job are an error, and not mixed in.
    other = cluster.predict(street, "tiny", out, **(job | {"intrinsics": (150.0, 150.0, 96.0, 32.0)}))
    assert other.done == 0 and len(other.failed) == 6
    assert all("another intrinsics" in why and "overwrite" in why for _, why in other.failed)
    assert cluster.predict(street / "left", "tiny", tmp_path / "few", **job).images == 3


def test_broken_images_are_named_and_the_others_done(street, tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    for i in range(3):
        (folder / f"{i}.png").write_bytes((street / "left" / f"{i}.png").read_bytes())
    (folder / "1.png").write_bytes(b"no picture")
    summary = cluster.predict(folder, "tiny", tmp_path / "out", intrinsics=CAMERA)
    assert summary.done == 2 and [name for name, _ in summary.failed] == [str(folder / "1.png")]
    assert "1.png" in summary.failed[0][1]
    with pytest.raises(FileNotFoundError, match="nowhere"):
        cluster.predict(tmp_path / "nowhere", "tiny", tmp_path / "out")
    with pytest.raises(deepfusion.DeepFusionError, match="no-such-network"):
        cluster.predict(folder, "no-such-network", tmp_path / "out")
    with pytest.raises(ValueError, match="save"):
        cluster.predict(folder, "tiny", tmp_path / "out", save=["plys"])
    with pytest.raises(ValueError, match="does not predict uncertainty"):
        cluster.predict(folder, "tiny", tmp_path / "out", save=["sigma"])


def test_uncertainty_is_saved(street, tmp_path):
    kinds = ["sigma", "confidence"]
    summary = cluster.predict(street / "left" / "0.png", "street", tmp_path, intrinsics=CAMERA, save=kinds)
    assert summary.done == 1
    expected = deepfusion.load("street").predict(street / "left" / "0.png", CAMERA)
    for kind in kinds:
        assert np.array_equal(np.load(tmp_path / f"0_{kind}.npy"), getattr(expected, kind))


def test_a_worker_that_is_killed_loses_nothing_and_does_nothing_twice(street, tmp_path):
    folder, out = tmp_path / "images", tmp_path / "out"
    folder.mkdir()
    pixels = np.asarray(Image.open(street / "left" / "0.png"))
    for i in range(200):
        # Each image is different, so that none can be mistaken for another.
        Image.fromarray(np.roll(pixels, i, axis=1)).save(folder / f"{i:03}.png")

    first, killed = {}, []

    def kill():
        """Kills a worker's process once some images are done, and records which."""
        while len(list(out.glob("*.json"))) < 20:
            time.sleep(0.01)
        first.update({file: file.stat().st_mtime_ns for file in out.glob("*.json")})
        for actor in _actors():
            os.kill(actor, signal.SIGKILL)
            killed.append(actor)
            return

    killer = threading.Thread(target=kill)
    killer.start()
    summary = cluster.predict(folder, "tiny", out, intrinsics=CAMERA, workers=2)
    killer.join()
    assert killed, "no worker was running that could be killed"
    assert len(first) < 200, "all images were done before the worker was killed"
    assert (summary.images, summary.done, summary.kept, summary.failed) == (200, 200, 0, [])
    assert len(list(out.glob("*.json"))) == len(list(out.glob("*_depth.png"))) == 200
    assert all(file.stat().st_mtime_ns == when for file, when in first.items()), "predicted a second time"
    assert not [file for file in out.glob("*.json") if json.loads(file.read_text())["image"] != str(folder / f"{file.stem}.png")]
    model = deepfusion.load("tiny")
    for i in [0, 77, 199]:
        expected = model.predict(folder / f"{i:03}.png", CAMERA).depth
        assert np.allclose(np.asarray(Image.open(out / f"{i:03}_depth.png")) / 256, expected.clip(0, 255.99), atol=0.5 / 256 + 1e-6)


def _actors():
    """The processes of Ray's workers that have loaded a network."""
    for process in os.listdir("/proc"):
        if process.isdigit():
            try:
                with open(f"/proc/{process}/cmdline", "rb") as line:
                    if line.read().startswith(b"ray::") and "_native" in open(f"/proc/{process}/maps").read():
                        yield int(process)
            except OSError:
                continue


@pytest.fixture
def bucket():
    """The bucket `fleet` in S3, simulated by moto's server on this machine: its file system, and the options to connect to it."""
    moto = pytest.importorskip("moto.server")
    s3fs = pytest.importorskip("s3fs")
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    try:
        host, port = server.get_host_and_port()
        options = {"key": "a", "secret": "b", "client_kwargs": {"endpoint_url": f"http://{host}:{port}"}}
        fs = s3fs.S3FileSystem(**options)
        # All servers of a process share their buckets.
        urllib.request.urlopen(urllib.request.Request(f"http://{host}:{port}/moto-api/reset", method="POST")).close()
        fs.mkdir("fleet")
        yield fs, options
    finally:
        server.stop()


def test_an_object_store(street, bucket):
    fs, options = bucket
    fs.put(str(street / "left"), "fleet/images", recursive=True)
    job = dict(intrinsics=CAMERA, save=["npy"], workers=1, storage_options=options)
    summary = cluster.predict("s3://fleet/images", "tiny", "s3://fleet/depth", **job)
    assert (summary.done, summary.kept, summary.failed) == (3, 0, [])
    fs.invalidate_cache()
    with fs.open("fleet/depth/1_depth.npy") as file:
        depth = np.load(file)
    assert np.array_equal(depth, deepfusion.load("tiny").predict(street / "left" / "1.png", CAMERA).depth)
    again = cluster.predict("s3://fleet/images/*.png", "tiny", "s3://fleet/depth", **job)
    assert (again.done, again.kept, again.failed) == (0, 3, [])


@pytest.fixture
def memory():
    """An object store in this process, empty."""
    fs = fsspec.filesystem("memory")
    fs.store.clear()
    yield fs
    fs.store.clear()


def worker(output, **others):
    """A worker of a job that saves arrays, in this process."""
    job = dict(id=output, model="tiny", precision="f32", data_set=None, intrinsics=CAMERA, focal_correction=True, stretch=False,
               post_process=None, save=("npy",), overwrite=False, threads=1, options={}, weights=None, device="cpu", gpus=0)  # fmt: skip
    return _predict._Worker(_predict._Job(output=output, **(job | others)))


def test_an_old_sidecar_does_not_mark_new_depth_as_done(street, memory, monkeypatch):
    monkeypatch.setenv("RAYON_NUM_THREADS", "1")
    image = str(street / "left" / "0.png")
    row = {"image": np.array([image]), "name": np.array(["0"])}

    def depth():
        return np.load(io.BytesIO(memory.cat_file("/depth/0_depth.npy")))

    assert worker("memory://depth")(row)["outcome"] == ["done"]
    first, write = depth(), _storage.Folder.write

    def dies(self, name, data):
        """Like a worker that is killed before it writes the sidecar."""
        if name.endswith(".json"):
            raise OSError("killed")
        write(self, name, data)

    with monkeypatch.context() as patched:
        patched.setattr(_storage.Folder, "write", dies)
        other = worker("memory://depth", id="b", intrinsics=(150.0, 150.0, 96.0, 32.0), overwrite=True)(row)
    assert other["outcome"] == ["failed"] and depth().shape == first.shape and not np.array_equal(depth(), first)
    assert worker("memory://depth", id="c")(row)["outcome"] == ["done"]
    assert np.array_equal(depth(), first)
    assert worker("memory://depth", id="d")(row)["outcome"] == ["kept"]


def test_whatever_a_file_system_raises_is_one_images_failure(street, memory, monkeypatch):
    monkeypatch.setenv("RAYON_NUM_THREADS", "1")
    memory.put(str(street / "left"), "/images", recursive=True)
    get = type(memory).get_file

    def fails(self, path, *arguments, **options):
        if path.endswith("1.png"):
            # Not an OSError, like botocore's exceptions.
            raise RuntimeError("reset by peer")
        return get(self, path, *arguments, **options)

    monkeypatch.setattr(type(memory), "get_file", fails)
    urls = [f"memory://images/{i}.png" for i in range(3)]
    answer = worker("memory://depth")({"image": np.array(urls), "name": np.array(["0", "1", "2"])})
    assert answer["outcome"] == ["done", "failed", "done"] and "reset by peer" in answer["why"][1]


def test_a_folder_with_an_embedded_networks_name_is_used_if_it_is_a_run(street, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tiny").mkdir()
    (tmp_path / "tiny" / "0.png").write_bytes((street / "left" / "0.png").read_bytes())
    for name in ["tiny", "tiny/", Path("tiny")]:
        assert _storage.network(name) == _storage.start(name) == "tiny"
    assert _storage.weights_mark("tiny", {}) is None
    assert cluster.predict(street / "left", "tiny", "depth", intrinsics=CAMERA, workers=1).done == 3
    assert _storage.network("./tiny") == _storage.network("tiny/../tiny") == str(tmp_path / "tiny")
    assert (_storage.start(None), _storage.start("none"), _storage.network("s3://runs/tiny")) == (None, "none", "s3://runs/tiny")
    for left in ["config.toml", "best.safetensors"]:
        (tmp_path / "tiny" / left).touch()
        assert _storage.network("tiny") == _storage.start(Path("tiny")) == str(tmp_path / "tiny")
        (tmp_path / "tiny" / left).unlink()


def test_what_a_worker_cannot_load_ends_the_job_with_the_reason(street, tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="int4"):
        cluster.predict(street, "tiny", tmp_path, precision="int4")
    # As on a machine whose processor lacks the precision.
    monkeypatch.setattr(_predict, "_check", lambda *_: None)
    with pytest.raises(deepfusion.DeepFusionError) as expected:
        deepfusion.load("tiny", data_set="nowhere")
    begun = time.monotonic()
    with pytest.raises(deepfusion.DeepFusionError) as found:
        cluster.predict(street, "tiny", tmp_path, data_set="nowhere", workers=2)
    assert (str(found.value), found.value.hint) == (str(expected.value), expected.value.hint)
    assert time.monotonic() - begun < 60


def test_this_machines_processor_need_not_compute_as_the_workers_do(monkeypatch):
    load, asked = deepfusion.load, []

    def lacks(model, *, precision="f32", **options):
        asked.append(precision)
        if precision != "f32":
            raise deepfusion.DeepFusionError(f"engine `fused`: {precision} needs a processor with more; this one has it not")
        return load(model, **options)

    monkeypatch.setattr(deepfusion, "load", lacks)
    for precision in ["bf16", "int8"]:
        _predict._check("tiny", precision, None, ["npy"], None)
    assert asked == ["f32", "f32", "int8"]

    def uncalibrated(model, *, precision="f32", **options):
        if precision == "int8":
            raise deepfusion.DeepFusionError("int8: the network is not calibrated")
        return load(model, **options)

    monkeypatch.setattr(deepfusion, "load", uncalibrated)
    with pytest.raises(deepfusion.DeepFusionError, match="calibrated"):
        _predict._check("tiny", "int8", None, ["npy"], None)


def test_a_fleet_is_checked(tmp_path):
    drives = [str(deepfusion.simulate(tmp_path / f"{seed}", frames=4, seed=seed, size=(192, 64))) for seed in (3, 4)]
    rows = cluster.inspect([*drives, tmp_path / "nowhere"])
    assert [row["recording"] for row in rows] == [*drives, str(tmp_path / "nowhere")]
    assert [row["frames"] for row in rows] == [4, 4, None] and rows[0]["usable_pairs"] == 3
    assert rows[0]["failed"] is None and "nowhere" in rows[2]["failed"]
    lines = cluster.table(rows).splitlines()
    assert len(lines) == 5 and lines[0].split()[0] == "recording" and lines[-1].startswith("in all")
    assert lines[-1].split()[2:5] == ["2", "8", "6"]
    looked = cluster.doctor(drives)
    assert [row["report"] for row in looked] == [deepfusion.doctor(drive) for drive in drives]
    assert looked[0]["frames"] == 4


def test_a_fleets_recording_comes_with_the_files_beside_it(tmp_path, bucket):
    fs, options = bucket
    drive = deepfusion.simulate(tmp_path / "kitti", frames=4, seed=3, size=(192, 64))
    fs.put(str(drive), f"fleet/2011_09_26/{drive.name}", recursive=True)
    for file in drive.parent.glob("calib_*.txt"):
        fs.put_file(str(file), f"fleet/2011_09_26/{file.name}")
    url = f"s3://fleet/2011_09_26/{drive.name}"
    here, there = (cluster.doctor([path], storage_options=options)[0] for path in (drive, url))
    assert there["failed"] is None and there["findings"] == here["findings"] and there["frames"] == 4
    assert cluster.inspect([url], storage_options=options)[0]["usable_pairs"] == 3


def test_files_of_a_recording_are_known_by_their_names(memory, monkeypatch):
    monkeypatch.setattr(_storage, "_MOST_BESIDE", 100)
    for name in ["drive.mp4", "drive.toml", "drive.csv", "dataset.toml", "calibration.yml", "other.mp4", "other.toml", "deep/dataset.toml"]:
        memory.pipe_file(f"/fleet/{name}", b"x")
    memory.pipe_file("/fleet/drive.bag", bytes(100))
    memory.pipe_file("/fleet/bag/metadata.yaml", b"x")
    memory.pipe_file("/fleet/bag.toml", b"x")
    memory.pipe_file("/alone.mp4", b"x")

    def fetched(url):
        with _storage.Sources({}).local_recording(url) as path:
            return Path(path).name, sorted(str(file.relative_to(Path(path).parent)) for file in Path(path).parent.rglob("*.*"))

    shared = ["bag.toml", "calibration.yml", "dataset.toml"]
    assert fetched("memory://fleet/drive.mp4") == ("drive.mp4", sorted([*shared, "drive.csv", "drive.mp4", "drive.toml"]))
    assert fetched("memory://fleet/bag/") == ("bag", sorted([*shared, "bag/metadata.yaml"]))
    assert fetched("memory://alone.mp4") == ("alone.mp4", ["alone.mp4"])


def test_a_recording_that_cannot_be_read_does_not_stop_the_others(tmp_path, monkeypatch):
    monkeypatch.setenv("RAYON_NUM_THREADS", "3")
    drive = str(deepfusion.simulate(tmp_path / "drive", frames=4, seed=3, size=(192, 64)))

    def silent(path):
        raise RuntimeError

    monkeypatch.setitem(_fleet._EMPTY, silent, {"frames": None})
    assert _fleet._look(silent, drive, {}) == {"recording": drive, "frames": None, "failed": "RuntimeError"}
    assert os.environ["RAYON_NUM_THREADS"] == "1"

    def dies(look, url, options):
        if url.endswith("bad"):
            os._exit(1)
        return {"recording": url, "frames": 4, "failed": None}

    monkeypatch.setattr(_fleet, "_look", dies)
    rows = cluster.inspect([drive, tmp_path / "bad", drive])
    assert [row["frames"] for row in rows] == [4, None, 4]
    assert rows[1]["recording"] == str(tmp_path / "bad") and rows[1]["failed"] and rows[1]["layout"] is None


SMALL = {"preset": "tiny", "steps": 2, "batch": 2, "size": {"width": 64, "height": 64}, "validation_share": 0.3}


def test_trials_of_a_setting(tmp_path):
    from ray import tune

    drive = deepfusion.simulate(tmp_path / "street", frames=10, seed=3, size=(192, 64))
    space = {"learning_rate": tune.grid_search([1e-5, 1e-4]), "loss.smoothness": tune.grid_search([0.0, 0.01])}
    trials = cluster.tune(space, drive, config=SMALL, out=tmp_path / "trials", init="none")
    assert len(trials) == 4 and all(trial.error is None for trial in trials)
    assert {(trial.settings["learning_rate"], trial.settings["loss.smoothness"]) for trial in trials} == {
        (rate, smooth) for rate in (1e-5, 1e-4) for smooth in (0.0, 0.01)
    }
    selections = [trial.selection for trial in trials]
    assert selections == sorted(selections)
    assert all(trial.step == 2 and (trial.path / "best.safetensors").exists() for trial in trials)
    # The run has the setting.
    assert deepfusion.load(trials[0].path).step > 0
    assert f"smoothness = {trials[0].settings['loss.smoothness']}" in (trials[0].path / "config.toml").read_text()

    wanted = {"all": {}, "no smoothness": {"loss": {"smoothness": 0.0}}, "wrong": {"loss.no_such": 1}}
    config = {**SMALL, "loss": {"speed": 0.125}}
    rows = cluster.ablate(wanted, drive, seeds=[1], config=config, out=tmp_path / "rows", init="none")
    assert list(rows) == list(wanted) and all(len(tried) == 1 for tried in rows.values())
    (whole,), (without,), (wrong,) = rows.values()
    assert (whole.row, whole.settings) == ("all", {"seed": 1}) and whole.error is None
    assert (without.row, without.settings) == ("no smoothness", {"loss.smoothness": 0.0, "seed": 1})
    assert wrong.selection is None and "no_such" in wrong.error and wrong.settings == {"loss.no_such": 1, "seed": 1}
    written = (without.path / "config.toml").read_text()
    assert "smoothness = 0.0" in written and "speed = 0.125" in written


def test_settings_are_merged_key_by_key():
    fixed = {"preset": "tiny", "loss": {"speed": 0.2, "smoothness": 0.1}, "camera": {"fx": 1.0}}
    assert _tune.merged(fixed, {"loss": {"smoothness": 0}, "camera": None}) == {
        "preset": "tiny", "loss.speed": 0.2, "loss.smoothness": 0, "camera.fx": 1.0, "camera": None,
    }  # fmt: skip
    assert _tune.merged({"loss": {"speed": 0.2}}, {"loss.speed": 0.3}) == _tune.merged({"loss.speed": 0.2}, {"loss": {"speed": 0.3}})


def test_values_that_are_not_finite_are_worst():
    nan, inf = math.nan, math.inf
    best = None
    for value, expected in [(nan, None), (0.5, 0.5), (nan, 0.5), (-inf, 0.5), (0.75, 0.5), (0.25, 0.25)]:
        best = _tune.lower(best, value)
        assert best == expected

    def order(mode, *values):
        trials = [_tune.Trial({}, None, None, None, {} if value is None else {"figure": value}, None, str(value)) for value in values]
        return [trial.row for trial in _tune.best_first(trials, "figure", mode)]

    assert order("min", nan, 2.0, None, 1.0, inf, 3) == ["1.0", "2.0", "3", "nan", "None", "inf"]
    assert order("max", 1.0, nan, 2.0, -inf, None, 3) == ["3", "2.0", "1.0", "nan", "-inf", "None"]


def training_workers():
    """The processes of Ray Train's workers."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                name = file.read()
        except OSError:
            continue
        if b"TrainWorker" in name or b"_RayTrainWorker" in name:
            found.append(int(pid))
    return found


def test_two_workers_train_a_network_although_one_is_killed(tmp_path):
    pytest.importorskip("torch")
    pytest.importorskip("ray.train.torch")
    street = deepfusion.simulate(tmp_path / "street", frames=16, seed=3, size=(320, 96))
    config = {"preset": "tiny", "steps": 40, "batch": 1, "size": {"width": 64, "height": 64}, "seed": 4, "validation_share": 0.2,
              "validate_every": 4, "depth_net.encoder.frozen_statistics": True}  # fmt: skip
    alone = deepfusion.train({**config, "accumulate": 2}, street, out=tmp_path / "alone", init="none")
    out = tmp_path / "shared"
    killed = []

    def kill_one():
        while not killed:
            workers = training_workers() if (out / "last.safetensors").exists() else []
            if workers:
                os.kill(workers[-1], signal.SIGKILL)
                killed.append(workers[-1])
            time.sleep(0.02)

    killer = threading.Thread(target=kill_one, daemon=True)
    killer.start()
    run = cluster.train(config, street, out=out, workers=2, init="none")
    assert killed and run.step == 40
    lines = [line.split(",") for line in (out / "log.csv").read_text().splitlines()]
    steps = [int(line[0]) for line in lines if line[1] == "train"]
    assert steps[-1] == 40
    assert run.losses["total"] == pytest.approx(alone.losses["total"], rel=1e-3)


def test_a_run_starts_again_if_a_worker_dies_before_the_first_checkpoint(tmp_path):
    pytest.importorskip("torch")
    pytest.importorskip("ray.train.torch")
    street = deepfusion.simulate(tmp_path / "street", frames=10, seed=3, size=(192, 64))
    out = tmp_path / "shared"
    killed = []

    def kill_one():
        log = out / "log.csv"
        while not killed:
            begun = log.exists() and ",train," in log.read_text()
            workers = training_workers() if begun and not (out / "last.safetensors").exists() else []
            if workers:
                killed.append({file.name for file in out.iterdir()})
                os.kill(workers[-1], signal.SIGKILL)
            time.sleep(0.002)

    killer = threading.Thread(target=kill_one, daemon=True)
    killer.start()
    run = cluster.train({**SMALL, "steps": 40, "batch": 1}, street, out=out, workers=2, init="none")
    assert killed and {"config.toml", "log.csv", "panels"} <= killed[0] and run.step == 40
    lines = [line.split(",") for line in (out / "log.csv").read_text().splitlines()]
    assert [int(line[0]) for line in lines if line[1] == "train"] == list(range(1, 41))
    assert len(list(out.glob("events.out.tfevents*"))) == 1


def test_only_files_of_a_run_that_had_just_started_are_removed(tmp_path):
    out = tmp_path / "run"
    _train._check_begun(out)
    (out / "panels").mkdir(parents=True)
    left = {"config.toml": "steps = 2\n[findings.camera]\nfx = 1.0\n", "log.csv": "step,split,total\n", "panels/000001.png": "",
            "events.out.tfevents.1795936607.deepfusion.2034": "", ".last.safetensors.2034-0123456789abcdef.partial": ""}  # fmt: skip
    for name, text in left.items():
        (out / name).write_text(text)
    _train._check_begun(out)
    others = {"config.toml": "mine = 1", "log.csv": "time,speed", "notes.txt": "", "best.safetensors": "", "panels/me.png": ""}
    for name, text in others.items():
        (out / name).write_text(text)
        # Nothing is started, and no file is lost.
        with pytest.raises(deepfusion.DeepFusionError, match=re.escape(name)) as caught:
            cluster.train(SMALL, tmp_path / "nowhere", out=out)
        assert "another folder" in caught.value.hint
        assert (out / name).read_text() == text and all((out / one).exists() for one in left)
        if name in left:
            (out / name).write_text(left[name])
        else:
            (out / name).unlink()
    _train._check_begun(out)


def test_the_device_is_checked_before_anything_starts(street, tmp_path):
    def refused(error, **options):
        with pytest.raises(error) as caught:
            cluster.predict(street, "tiny", tmp_path / "out", **options)
        return f"{caught.value} {getattr(caught.value, 'hint', '')}"

    assert "0 or more" in refused(ValueError, gpus_per_worker=-1)
    assert "idle" in refused(ValueError, gpus_per_worker=1, device="cpu")
    assert "cpu, " in refused(deepfusion.DeepFusionError, device="gpu")
    lacking = next((name for name in ("metal", "cuda", "wgpu", "vulkan") if name not in deepfusion.devices()), None)
    if lacking is not None:
        assert f"--features {lacking}" in refused(deepfusion.DeepFusionError, device=lacking)
    if deepfusion.devices() == ["cpu"]:
        assert "no `cuda` backend" in refused(deepfusion.DeepFusionError, gpus_per_worker=1)
    assert not (tmp_path / "out").exists()

    for options, expected in [
        ({"backend": "mpi"}, "gloo"),
        ({"backend": "nccl"}, "use_gpu"),
        ({"device": "auto"}, "use_gpu"),
        ({"device": "cpu", "use_gpu": True}, "idle"),
    ]:
        with pytest.raises(ValueError, match=expected):
            cluster.train(SMALL, street, out=tmp_path / "run", **options)
    assert not (tmp_path / "run").exists()


def test_the_processor_by_name_is_the_default(street, tmp_path):
    """The same outputs, so that an earlier job is continued."""
    job = dict(intrinsics=CAMERA, workers=1)
    assert cluster.predict(street / "left", "tiny", tmp_path / "out", **job).done == 3
    assert cluster.predict(street / "left", "tiny", tmp_path / "out", **job, device="cpu", gpus_per_worker=0).kept == 3


def test_each_worker_takes_a_gpu_of_its_own(monkeypatch):
    from deepfusion.ray._devices import numbered

    assert [numbered("cuda", index) for index in range(2)] == ["cuda:0", "cuda:1"]
    monkeypatch.setattr(deepfusion, "devices", lambda: ["cpu", "vulkan", "cuda"])
    assert numbered("auto", 1) == "cuda:1"
    monkeypatch.setattr(deepfusion, "devices", lambda: ["cpu"])
    assert numbered("auto", 1) == "cpu"


GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "on-a-cluster.md"

# The trainings are shortened here.
SHORTER = [
    ("frames=40", "frames=10, size=(192, 64)"),
    ('"steps": 20', '"steps": 2, "size": {"width": 64, "height": 64}, "validation_share": 0.3'),
    ("seeds=[1, 2, 3]", "seeds=[1]"),
    ("trials=2", "trials=1"),
]


def test_the_code_of_the_guide_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)
    assert len(blocks) >= 5
    names: dict = {}
    skipped = set()
    for shown in blocks:
        for long, short in SHORTER:
            shown = shown.replace(long, short)
        if "deepfusion.ray.train(" in shown and not _has("torch"):
            skipped.add("torch")
        elif shown.startswith("# mpiexec"):
            launcher = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
            if launcher is None or not _has("mpi4py"):
                skipped.add("MPI")
                continue
            # A new run, not the one of the previous block.
            (tmp_path / "learn.py").write_text(shown.replace('out="shared"', 'out="by-mpi"'))
            words = [launcher, "-n", "2", "--oversubscribe", "--allow-run-as-root", "--bind-to", "none", sys.executable, "learn.py"]
            subprocess.run(words, check=True, timeout=300)
            assert (tmp_path / "by-mpi" / "last.safetensors").exists()
        else:
            exec(compile(shown, str(GUIDE), "exec"), names)
    assert (names["summary"].done, names["summary"].failed) == (10, []) and "bad" in names
    assert all(trial.error is None for trial in names["trials"]) and list(names["rows"]) == ["all", "no smoothness"]
    assert "torch" in skipped or names["run"].step == 2


def _has(package):
    from importlib.util import find_spec

    return find_spec(package) is not None


def test_trials_share_the_arguments_of_training(street):
    """And each is given its device."""
    learning = _tune._learning("none", [street], "3", 0, None)
    assert learning == {"init": "none", "validation": [str(street)], "camera": "3", "device": "cpu"}
    for gpus, device, expected in [(-1, None, "gpus_per_trial"), (0, "auto", "needs gpus_per_trial"), (1, "cpu", "idle")]:
        with pytest.raises(ValueError, match=expected):
            _tune._learning(None, None, None, gpus, device)
