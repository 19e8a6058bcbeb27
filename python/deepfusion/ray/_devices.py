"""The devices of a cluster's workers."""

from __future__ import annotations

import deepfusion
from deepfusion import _native


def of_workers(device: str | None, gpus: float) -> str:
    """The device that each worker opens, given `gpus` GPUs: by default one of those, else the processor.

    A wrong name, or a backend that the package lacks, is an error here rather than in each worker.
    """
    if device is None:
        device = "auto" if gpus else "cpu"
    _native.check_device(device)
    if gpus and device == "cpu":
        raise ValueError('device: expected a GPU backend or "auto", found "cpu": the GPU of each worker would be idle')
    if gpus and device == "auto" and deepfusion.devices() == ["cpu"]:
        # This raises an error about CUDA: the GPUs that Ray counts are mostly NVIDIA's.
        _native.check_device("cuda")
    return device


def numbered(device: str, index: int) -> str:
    """The GPU with this index, of the requested backend, or for "auto" of the first that the package has."""
    if device == "auto":
        built = deepfusion.devices()
        device = next((one for one in ("cuda", "metal", "vulkan", "wgpu") if one in built), "cpu")
    return device if device == "cpu" else f"{device}:{index}"
