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
    """Something that stands on the ground: a box in the camera's axes (x right, y down, z ahead), metres, seconds, radians."""

    id: int
    """The track it belongs to; the same from frame to frame."""
    center_m: Vector
    """Centre of the box."""
    size_m: Vector
    """Length, width and height."""
    yaw_rad: float
    """KITTI's rotation_y: the length points along (cos, 0, -sin) of it. Without a velocity it is known up to half a turn."""
    distance_m: float
    """From the camera to the centre."""
    sigma_m: float | None
    """Standard deviation of that, where the depth came with one."""
    velocity_mps: Vector | None
    """Over ground, in the camera's axes; None before it could be measured."""
    moving: bool | None
    """Whether it moves over ground; None before that is known."""
    confidence: float
    """How sure it is that something of this kind is there, 0 to 1."""
    pixels: int
    """How many pixels see it, of a depth image at most 640 wide; 0 where the track goes on without being seen."""
    bounds: tuple[int, int, int, int] | None
    """Left, top, right, bottom of those pixels, in pixels of the image."""
    corners_m: NDArray[np.float64] = field(compare=False, repr=False)
    """8 x 3, the lower four corners first."""


@dataclass(frozen=True)
class Ground:
    """The road: points p of the camera's axes with normal · p + offset_m = 0."""

    normal: Vector
    """Upwards, of length 1."""
    offset_m: float
    """The camera's height above it, metres."""


@dataclass(frozen=True)
class Collision:
    """A meeting that is to come, if all goes on as it does."""

    id: int
    """The target."""
    time_s: float
    """Seconds from now."""


@dataclass(frozen=True)
class Surroundings:
    """What stands before the camera."""

    targets: list[Target]
    """In order of distance."""
    ground: Ground | None
    """None where none was found, and then there are no targets."""
    collision: Collision | None
    """The first target that the vehicle's front would touch within 10 s, where its speed is given and the camera looks ahead."""


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
    raise TypeError(f"{value!r} is no setting")


class Perception:
    """Follows targets over the frames of a recording; `perceive` is for single images.

    `exact=True` is for measured or simulated depth, else the settings are those for a network's. Further settings by name, as in
    `deepfusion perceive --config`: `max_depth_m`, `min_confidence`, `min_pixels`, …
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
        """The targets in a depth image: H x W metres, 0 where there is none; `intrinsics` (fx, fy, cx, cy, or the 3 x 3
        matrix) of that size, `sigma` its standard deviation.

        With `time_s` (seconds, on any clock) and `world_from_cam` (4 x 4, the camera to a frame that stays where it is) targets are
        followed: they keep their id, are reported once they were seen twice, and get a velocity. `speed_mps` and `yaw_rate_radps` (positive
        to the left) are the vehicle's, for `Surroundings.collision`, and `camera_yaw_rad` is by how much the camera looks to the left of the way
        straight ahead (`Dataset.camera_yaw_rad`): of one that looks to the side, more than 60 degrees or None, nothing is said. Where the
        motion from the last frame is not known, call `reset`, and begin anew with a pose.
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
        """What comes next does not go on from what was."""
        self._native.reset()


def perceive(
    depth: ArrayLike,
    intrinsics: ArrayLike,
    *,
    sigma: ArrayLike | None = None,
    exact: bool = False,
    **settings: Any,
) -> Surroundings:
    """The targets in one depth image: what `deepfusion perceive` finds in a single picture. As `Perception.detect`, without a past."""
    return Perception(exact=exact, **settings).detect(depth, intrinsics, sigma=sigma)
