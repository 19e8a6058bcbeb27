#!/usr/bin/env python3
"""What two processes that learn one network cost and change: seconds a step, seconds of it in the sum of gradients, and how far the losses are
from one process with twice the batches. By MPI (pip install "./python[mpi]"), and by torch's gloo where torch is installed.

    benches/bulk/workers.py OUT [--preset tiny] [--size 320x96] [--batch 2] [--steps 12]

One process has two threads, two have one each. Times are medians after the third step.
"""

import argparse
import json
import os
import shutil
import socket
import statistics
import subprocess
import sys
import time
from pathlib import Path

import deepfusion
import deepfusion.distributed


class Timed:
    """A connection that counts its seconds in `sum`."""

    def __init__(self, inner):
        self.inner, self.seconds, self.values = inner, 0.0, 0
        self.rank, self.count = inner.rank, inner.count

    def sum(self, values):
        begin = time.perf_counter()
        self.inner.sum(values)
        self.seconds += time.perf_counter() - begin
        self.values = max(self.values, len(values))


def learned(config, street, out, workers=None):
    """Losses, the median seconds of a step and of its sums."""
    losses, steps, sums = [], [], []
    last = [time.perf_counter(), 0.0]

    def listen(event):
        if event["event"] == "step":
            now = [time.perf_counter(), workers.seconds if workers else 0.0]
            losses.append(event["losses"]["total"])
            steps.append(now[0] - last[0])
            sums.append(now[1] - last[1])
            last[:] = now

    deepfusion.train(config, street, listen, out=out, init="none", workers=workers)
    values = workers.values if workers else 0
    return {"losses": losses, "step": statistics.median(steps[3:]), "sum": statistics.median(sums[3:]), "values": values}


def worker(kind, config, street, out):
    if kind == "torch":
        import torch.distributed

        torch.distributed.init_process_group("gloo")
        inner = deepfusion.distributed.Torch()
    else:
        inner = deepfusion.distributed.Mpi()
    found = learned(json.loads(config), street, out, Timed(inner))
    if inner.rank == 0:
        print(json.dumps(found), flush=True)


def launched(kind, config, street, out):
    """What rank 0 of two processes printed."""
    words = [sys.executable, __file__, "--worker", kind, json.dumps(config), str(street), str(out)]
    one = {**os.environ, "RAYON_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    if kind == "MPI":
        found = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
        if found is None:
            sys.exit('error: no mpiexec\nhint: pip install "./python[mpi]"')
        command = [found, "-n", "2", "--oversubscribe", "--allow-run-as-root", "--bind-to", "none", *words]
        texts = [subprocess.run(command, env=one, check=True, stdout=subprocess.PIPE, text=True).stdout]
    else:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            group = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(free.getsockname()[1]), "WORLD_SIZE": "2"}
        both = [subprocess.Popen(words, env={**one, **group, "RANK": str(rank)}, stdout=subprocess.PIPE, text=True) for rank in range(2)]
        texts = [process.communicate()[0] for process in both]
        if any(process.returncode for process in both):
            sys.exit("error: a worker failed: what it said is above")
    return json.loads(next(line for text in texts for line in text.splitlines() if line.startswith("{")))


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("out", type=Path)
    words.add_argument("--preset", default="tiny")
    words.add_argument("--size", default="320x96")
    words.add_argument("--batch", type=int, default=2)
    words.add_argument("--steps", type=int, default=12)
    asked = words.parse_args()
    if asked.steps < 5:
        words.error("--steps: at least 5")
    asked.out.mkdir(parents=True, exist_ok=True)
    street = asked.out / "street"
    shutil.rmtree(street, ignore_errors=True)
    street = deepfusion.simulate(street, frames=40, seed=3)
    width, height = map(int, asked.size.split("x"))
    config = {"preset": asked.preset, "steps": asked.steps, "batch": asked.batch, "size": {"width": width, "height": height}, "seed": 4,
              "validate_every": asked.steps, "depth_net.encoder.frozen_statistics": True, "accumulate": 1}  # fmt: skip

    def run(name):
        shutil.rmtree(asked.out / name, ignore_errors=True)
        return asked.out / name

    alone = learned({**config, "accumulate": 2}, street, run("alone"))
    print("| | s a step | of it in sums, ms | largest relative difference of a loss |\n|---|---|---|---|")
    print(f"| one process, twice the batches | {alone['step']:.3f} | – | – |", flush=True)
    for kind in ["MPI", "torch"]:
        if kind == "torch":
            try:
                import torch  # noqa: F401
            except ImportError:
                continue
        found = launched(kind, config, street, run(kind))
        off = max(abs(a / b - 1) for a, b in zip(found["losses"], alone["losses"]))
        print(f"| two by {kind}, {4e-6 * found['values']:.1f} MB of gradients | {found['step']:.3f} | {1e3 * found['sum']:.1f} | {off:.1e} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        worker(*sys.argv[2:])
    else:
        main()
