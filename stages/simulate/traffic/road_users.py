"""A road user at one instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.stages.simulate.bodies import Variant


@dataclass(frozen=True)
class RoadUser:
    """A vehicle or pedestrian, its pose and its velocity.

    map_SE3_base: (4, 4), pose of base_link, on the ground below the centre of the box, x forward.
    velocity_mps: (3,), in the map's axes. lights: those that are on, as its CAMs report them; a source of
    traffic without lights keeps the default.
    """

    id: str
    variant: Variant
    map_SE3_base: Float64
    velocity_mps: Float64
    lights: ExteriorLights = ExteriorLights.DAYTIME_RUNNING

    @property
    def position_m(self) -> Float64:
        """The origin of base_link in the map's frame (3,)."""
        position: Float64 = self.map_SE3_base[:3, 3]
        return position


def boxes_of(users: Sequence[RoadUser]) -> Boxes:
    """The true boxes of N road users in the map's frame: geometry (N, 7), labels, ids, velocities (N, 3)."""
    if not users:
        return Boxes()
    poses = np.array([user.map_SE3_base for user in users])
    geometry = np.empty((len(users), 7))
    bodies = (user.variant for user in users)
    geometry[:, 3:6] = [(each.length_m, each.width_m, each.height_m) for each in bodies]
    geometry[:, :3] = poses[:, :3, 3] + poses[:, :3, 2] * geometry[:, 5:6] / 2
    geometry[:, 6] = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    labels = np.array([CLASSES.index(user.variant.body.label) for user in users], dtype=np.int64)
    velocity = np.array([user.velocity_mps for user in users])
    return Boxes(geometry, labels, tuple(user.id for user in users), velocity)


def footprints(poses: Float64, sizes_m: Sequence[tuple[float, float]] | Float64) -> Float64:
    """Corners (N, 4, 2) in x, y of boxes with poses (N, 4, 4) and sizes (N, 2): length, width."""
    halves = np.asarray(sizes_m, dtype=np.float64)[:, None, :] / 2
    corners = halves * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    placed: Float64 = np.einsum("nij,nkj->nki", poses[:, :2, :2], corners) + poses[:, None, :2, 3]
    return placed
