"""From depth to 3D targets."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Target:
    """An object that stands on the ground: a box in the camera's axes (x right, y down, z forward), in metres, seconds, radians."""

    id: int
    """The track that it belongs to; the same from frame to frame."""
    center_m: Vector
    """Centre of the box."""
    size_m: Vector
    """Length, width and height."""
    yaw_rad: float
    """KITTI's rotation_y: the length points along (cos, 0, -sin) of it. Without a velocity, it is only known up to half a turn."""
    distance_m: float
    """From the camera to the centre."""
    sigma_m: float | None
    """Standard deviation of `distance_m`, if the depth came with one."""
    velocity_mps: Vector | None
    """Over ground, in the camera's axes; None until it could be measured."""
    moving: bool | None
    """Whether it moves over ground; None until that is known."""
    confidence: float
    """Confidence that the target exists, 0 to 1."""
    pixels: int
    """Number of its pixels, in a depth image at most 640 wide; 0 if its track continues without a detection."""
    bounds: tuple[int, int, int, int] | None
    """Left, top, right and bottom of those pixels, in pixels of the image."""
    corners_m: NDArray[np.float64] = field(compare=False, repr=False)
    """8 x 3, the lower four corners first."""


@dataclass(frozen=True)
class Ground:
    """The road: all points p in the camera's axes with normal · p + offset_m = 0."""

    normal: Vector
    """Points upwards; has length 1."""
    offset_m: float
    """Height of the camera above the road, in metres."""


@dataclass(frozen=True)
class Collision:
    """A collision that will happen if all motions continue unchanged."""

    id: int
    """The target."""
    time_s: float
    """Seconds from now."""


@dataclass(frozen=True)
class Surroundings:
    """What is in front of the camera."""

    targets: list[Target]
    """Sorted by distance."""
    ground: Ground | None
    """None if none was found; then there are no targets."""
    collision: Collision | None
    """The first target that the vehicle's front would touch within 10 s, if its speed is given and the camera looks ahead."""


def _surroundings(text: str) -> Surroundings:
    found = json.loads(text)
    targets = []
    for t in found["targets"]:
        velocity, bounds = t["velocity_mps"], t["bounds"]
        targets.append(
            Target(
                id=t["id"],
                center_m=tuple(t["center_m"]),
                size_m=tuple(t["size_m"]),
                yaw_rad=t["yaw_rad"],
                distance_m=t["distance_m"],
                sigma_m=t.get("sigma_m"),
                velocity_mps=None if velocity is None else tuple(velocity),
                moving=t["moving"],
                confidence=t["confidence"],
                pixels=t["pixels"],
                bounds=None if bounds is None else tuple(bounds),
                corners_m=np.array(t["corners_m"]),
            )
        )
    ground, collision = found["ground"], found["collision"]
    return Surroundings(
        targets=targets,
        ground=ground and Ground(tuple(ground["normal"]), ground["offset_m"]),
        collision=collision and Collision(collision["id"], collision["time_s"]),
    )


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays as Python's own."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"a setting cannot contain {value!r}")


class Perception:
    """Tracks targets over the frames of a recording; for single images, use `perceive`.

    `exact=True` is for measured or simulated depth; otherwise the settings are those for a network's depth. Further settings are
    passed by name, as in `deepfusion perceive --config`: `max_depth_m`, `min_confidence`, `min_pixels`, …
    """

    def __init__(self, *, exact: bool = False, **settings: Any) -> None:
        self._native = _native.Perception(json.dumps(settings, default=_plain), exact)

    def detect(
        self,
        depth: ArrayLike,
        intrinsics: ArrayLike,
        *,
        sigma: ArrayLike | None = None,
        time_s: float | None = None,
        world_from_cam: ArrayLike | None = None,
        speed_mps: float | None = None,
        yaw_rate_radps: float = 0.0,
        camera_yaw_rad: float | None = 0.0,
    ) -> Surroundings:
        """Finds the targets in a depth image: H x W metres, 0 where there is none. `intrinsics` (fx, fy, cx, cy, or the 3 x 3 matrix)
        are for that size; `sigma` is the depth's standard deviation.

        With `time_s` (in seconds, on any clock) and `world_from_cam` (4 x 4, from the camera to a fixed frame), targets are tracked:
        they keep their id, are reported once they have been seen twice, and get a velocity. `speed_mps` and `yaw_rate_radps`
        (positive to the left) are the vehicle's, for `Surroundings.collision`. `camera_yaw_rad` is how far the camera looks to the
        left of straight ahead (`Dataset.camera_yaw_rad`); for a camera that looks to the side (more than 60 degrees, or None), no
        collision is reported. If the motion since the last frame is not known, call `reset`, and start again with a new pose.
        """
        as_f32 = lambda a: np.ascontiguousarray(a, dtype=np.float32)  # noqa: E731
        pose = None if world_from_cam is None else np.ascontiguousarray(world_from_cam, dtype=np.float64)
        sigma = None if sigma is None else as_f32(sigma)
        return _surroundings(
            self._native.detect(
                as_f32(depth), intrinsics, sigma, time_s, pose, speed_mps, yaw_rate_radps, camera_yaw_rad
            )
        )

    def reset(self) -> None:
        """Forgets the earlier frames: the next one starts new tracks."""
        self._native.reset()


def perceive(
    depth: ArrayLike,
    intrinsics: ArrayLike,
    *,
    sigma: ArrayLike | None = None,
    exact: bool = False,
    **settings: Any,
) -> Surroundings:
    """Finds the targets in one depth image, as `deepfusion perceive` does in a single picture. Like `Perception.detect`, without
    earlier frames."""
    return Perception(exact=exact, **settings).detect(depth, intrinsics, sigma=sigma)
