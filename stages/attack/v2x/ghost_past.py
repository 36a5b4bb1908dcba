"""The way that a ghost vehicle claims to have come, for the path history of its CAMs."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, Protocol

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.stages.attack.v2x.ghost_motion import GhostMotion

STEP_NS = 100_000_000
"""Between the places of a past, as between those of a genuine station's path."""
_MOST_STEPS = 600
_MOST_PLACES = 3_000


class PastPose(NamedTuple):
    """Where a vehicle was at a time: its pose (4, 4) on the ground, at the middle."""

    time_ns: int
    map_SE3_base: Float64


class Motion(Protocol):
    """The motion of a ghost vehicle, also before it first sends."""

    def motion(self, time_ns: int) -> GhostMotion: ...


class Trail:
    """The poses of a vehicle that an attacker has seen, or heard of, step by step."""

    def __init__(self) -> None:
        self._poses: deque[PastPose] = deque(maxlen=_MOST_PLACES)

    def add(self, time_ns: int, map_SE3_base: Float64) -> None:
        """The vehicle's pose at the begin of the next step."""
        self._poses.append(PastPose(time_ns, map_SE3_base))

    def before(self, ghost: Motion, now_ns: int, map_SE3_front: Float64) -> list[PastPose]:
        """The past of a ghost vehicle that appears now ahead of this vehicle's front, oldest first.

        It came straight from where the vehicle's front is now, and before that the way of the vehicle
        itself, in the lane beside if it appears there.
        """
        front_m, ahead, left = map_SE3_front[:3, 3], map_SE3_front[:3, 0], map_SE3_front[:3, 1]
        straight: list[PastPose] = []
        for number in range(1, _MOST_STEPS + 1):
            at_ns = now_ns - number * STEP_NS
            pose = ghost.motion(at_ns).map_SE3_base
            if (pose[:3, 3] - front_m) @ ahead <= 0:
                break
            straight.append(PastPose(at_ns, pose))
        lead_ns = (len(straight) + 1) * STEP_NS
        beside_m = float((ghost.motion(now_ns).map_SE3_base[:3, 3] - front_m) @ left)
        followed = [PastPose(time_ns - lead_ns, _moved_left(pose, beside_m)) for time_ns, pose in self._poses]
        return [*followed, *reversed(straight)]


def _moved_left(pose: Float64, left_m: float) -> Float64:
    moved = np.array(pose)
    moved[:3, 3] = transform_points(pose, [0.0, left_m, 0.0])
    return moved
