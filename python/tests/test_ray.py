"""The work of a cluster, on one machine with two workers."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import deepfusion
import numpy as np
import pytest
from PIL import Image

ray = pytest.importorskip("ray")
pytest.importorskip("ray.data")

import deepfusion.ray as cluster  # noqa: E402


@pytest.fixture(scope="module", autouse=True)
def two_cores():
    # No telemetry, no page: a test's cluster is nobody's business.
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

    # Again: nothing is made. A file that was cut off: that image is.
    written = {file: file.stat().st_mtime_ns for file in out.rglob("*.*")}
    again = cluster.predict(street, "tiny", out, **job)
    assert (again.done, again.kept) == (0, 6)
    assert written == {file: file.stat().st_mtime_ns for file in out.rglob("*.*")}
    (out / "left" / "1_depth.npy").write_bytes(bytes(len((out / "left" / "1_depth.npy").read_bytes())))
    os.truncate(out / "mirrored" / "2_depth.png", 40)
    mended = cluster.predict(street, "tiny", out, **job)
    assert (mended.done, mended.kept) == (2, 4)
    assert np.array_equal(np.load(out / "left" / "1_depth.npy"), model.predict(street / "left" / "1.png", CAMERA).depth)

    # Of something else: said, not mixed in.
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
    with pytest.raises(ValueError, match="how sure"):
        cluster.predict(folder, "tiny", tmp_path / "out", save=["sigma"])


def test_how_sure_the_network_is(street, tmp_path):
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
        # Each its own, so that none could stand for another.
        Image.fromarray(np.roll(pixels, i, axis=1)).save(folder / f"{i:03}.png")

    first, killed = {}, []

    def kill():
        """Kills a process of the work once some images are done; notes which those were."""
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
    assert killed, "no worker was at work when it was to be killed"
    assert len(first) < 200, "all was done when the worker was killed"
    assert (summary.images, summary.done, summary.kept, summary.failed) == (200, 200, 0, [])
    assert len(list(out.glob("*.json"))) == len(list(out.glob("*_depth.png"))) == 200
    assert all(file.stat().st_mtime_ns == when for file, when in first.items()), "made a second time"
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


def test_an_object_store(street, tmp_path, monkeypatch):
    """Inputs and outputs in S3, played by moto's server on this machine."""
    moto = pytest.importorskip("moto.server")
    s3fs = pytest.importorskip("s3fs")
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    try:
        host, port = server.get_host_and_port()
        options = {"key": "a", "secret": "b", "client_kwargs": {"endpoint_url": f"http://{host}:{port}"}}
        fs = s3fs.S3FileSystem(**options)
        fs.mkdir("fleet")
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
    finally:
        server.stop()


def test_a_fleet_is_looked_at(tmp_path):
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
    # The setting is the run's.
    assert deepfusion.load(trials[0].path).step > 0
    assert f"smoothness = {trials[0].settings['loss.smoothness']}" in (trials[0].path / "config.toml").read_text()

    rows = cluster.ablate({"all": {}, "no smoothness": {"loss.smoothness": 0.0}}, drive, seeds=[1], config=SMALL, out=tmp_path / "rows", init="none")
    assert list(rows) == ["all", "no smoothness"] and all(len(tried) == 1 for tried in rows.values())


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


def test_a_network_is_learned_by_two_workers_though_one_is_killed(tmp_path):
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


def test_what_computes_is_checked_before_anything_starts(street, tmp_path):
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
    """The same outputs, so that a job of before goes on."""
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

# Nothing is learned for long here.
SHORTER = [
    ("frames=40", "frames=10, size=(192, 64)"),
    ('"steps": 20', '"steps": 2, "size": {"width": 64, "height": 64}, "validation_share": 0.3'),
    ("seeds=[1, 2, 3]", "seeds=[1]"),
    ("trials=2", "trials=1"),
]


def test_what_the_guide_shows_runs(tmp_path, monkeypatch):
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
            # Another run than the block before made.
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
