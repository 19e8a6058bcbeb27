"""For PyTorch, which the package itself does not need: `pip install torch`."""

from __future__ import annotations

from typing import Any

try:
    import torch
    from torch.utils.data import Dataset as _TorchDataset
except ModuleNotFoundError as missing:
    raise ModuleNotFoundError("deepfusion.torch needs PyTorch: pip install torch", name="torch") from missing

from ._snippets import Snippets

__all__ = ["KittiLikeDataset"]


class KittiLikeDataset(_TorchDataset):
    """A recording's frames with their neighbours in time, as tensors: `deepfusion.Snippets` for a `torch.utils.data.DataLoader`.

    A sample is a dict: `image` 3 x H x W and `sources` N x 3 x H x W (float32, 0 to 1, RGB), `source_from_target` N x 4 x 4 (float32,
    metres), `intrinsics` 3 x 3 (pixels), `depth` 1 x H x W (metres, 0 where nothing was measured), `speed_mps`, `number`. Arguments
    are those of `deepfusion.Snippets`.
    """

    def __init__(self, path: Any, **options: Any) -> None:
        self.snippets = Snippets(path, **options)

    def __len__(self) -> int:
        return len(self.snippets)

    def __getitem__(self, index: int) -> dict[str, Any]:
        sample = self.snippets[index]
        # Shared without a copy until they become floats.
        image, sources = (torch.from_dlpack(sample[key]) for key in ("image", "sources"))
        return {
            "image": image.permute(2, 0, 1).float().div_(255),
            "sources": sources.permute(0, 3, 1, 2).float().div_(255),
            "source_from_target": torch.from_dlpack(sample["source_from_target"]).float(),
            "intrinsics": torch.from_dlpack(sample["intrinsics"]),
            "depth": torch.from_dlpack(sample["depth"])[None],
            "speed_mps": torch.tensor(sample["speed_mps"]),
            "number": sample["number"],
        }
