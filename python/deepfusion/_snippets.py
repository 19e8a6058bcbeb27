"""Training samples, as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._native import Dataset
from ._types import Camera, DepthKind


class Snippets:
    """A recording's frames, each with its neighbours in time and the camera's motion between them.

    A sample is a dict: `image` H x W x 3 (uint8), `sources` N x H x W x 3 (uint8), `source_from_target` N x 4 x 4 (float64, metres:
    transforms a point from the camera at the image to the camera at the source), `intrinsics` 3 x 3 (float32, pixels), `depth` H x W
    (float32, metres, 0 where nothing was measured), `speed_mps` (NaN if it is not known), `number` of the frame.

    `offsets` select the neighbours, in frames. Frames that lack one of them, or whose motion is not known, are left out. `depth_kind`
    is "z" or "velodyne".
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        offsets: Sequence[int] = (-1, 1),
        camera: Camera = "2",
        drive: int = 0,
        depth_kind: DepthKind = "z",
    ) -> None:
        self.recording = Dataset(path, camera=camera, drive=drive)
        """Reopened in another process."""
        self.offsets = tuple(offsets)
        self.depth_kind = depth_kind
        recording = self.recording
        # By the frames' numbers, since frames between two existing ones may be missing.
        places = {frame.number: place for place, frame in enumerate(recording)}

        def sources_of(number: int, place: int) -> list[int] | None:
            sources = [places.get(number + offset) for offset in self.offsets]
            there = [source for source in sources if source is not None and recording.motion(place, source) is not None]
            return there if len(there) == len(sources) else None

        found = {place: sources_of(number, place) for number, place in places.items()}
        self._sources = {place: sources for place, sources in found.items() if sources is not None}
        self.frames = list(self._sources)

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int) -> dict[str, Any]:
        place = self.frames[index]
        frame = self.recording[place]
        image = frame.image
        sources = self._sources[place]
        depth = frame.ground_truth(self.depth_kind)
        return {
            "image": image,
            "sources": np.stack([self.recording[source].image for source in sources]),
            "source_from_target": np.stack([self._motion(place, source) for source in sources]),
            "intrinsics": frame.K.astype(np.float32),
            "depth": np.zeros(image.shape[:2], np.float32) if depth is None else depth,
            "speed_mps": np.float32(np.nan if frame.speed_mps is None else frame.speed_mps),
            "number": frame.number,
        }

    def _motion(self, target: int, source: int) -> NDArray[np.float64]:
        motion = self.recording.motion(target, source)
        assert motion is not None, "frames without a motion are left out"
        return motion
