"""Which GPU belongs to which worker."""

from __future__ import annotations

import os

from . import _native
from .distributed import Workers

_LOCAL_RANKS = ("LOCAL_RANK", "OMPI_COMM_WORLD_LOCAL_RANK", "MPI_LOCALRANKID", "SLURM_LOCALID")
"""Variables in which torchrun, Open MPI, Intel's MPI and Slurm give a process its number on its machine."""


def own_gpu(device: str, workers: Workers | None) -> str:
    """The device of one of several workers: "cuda", and "auto" if that is CUDA, become the GPU that has the worker's number on its
    machine, among the GPUs that it sees."""
    if workers is not None and device == "auto":
        fastest = _native.fastest()
        # Other backends number GPUs, not processes.
        device = "cuda" if fastest.partition(":")[0] == "cuda" else fastest
    if workers is None or device != "cuda":
        return device
    rank = next((os.environ[name] for name in _LOCAL_RANKS if os.environ.get(name, "").isdecimal()), None)
    if rank is None:
        return device
    seen = os.environ.get("CUDA_VISIBLE_DEVICES")
    index = int(rank)
    # Some schedulers show each process only its own GPU.
    if seen:
        index %= len(seen.split(","))
    return f"{device}:{index}"
