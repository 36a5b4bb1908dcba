"""What the cameras and the radar of a CARLA server really measure, of a vehicle to the right of theirs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes
from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.stages.simulate.world.carla.cameras import (
    INSTANCE,
    RGB,
    ROAD_USERS,
    SEMANTIC,
    CarlaCamera,
    seen_objects,
)
from advpipe.stages.simulate.world.carla.finding import require
from advpipe.stages.simulate.world.carla.radars import CarlaRadar

CAMERA_KEYS = CameraSensor(
    image_size_x=320,
    image_size_y=180,
    x_m=0.0,
    z_m=2.2,
    yaw_deg=-75.0,
    images=("rgb", "depth", "semantic_segmentation", "instance_segmentation"),
)
RADAR_KEYS = RadarSensor(
    x_m=0.0,
    y_m=-1.4,
    z_m=0.8,
    yaw_deg=-75.0,
    horizontal_fov=80.0,
    points_per_second=20_000,
    elevation_resolution_deg=1.0,
)
"""The other vehicle is in the right half of their view."""

FEWEST_PIXELS, FEWEST_HITS = 100, 10
SAME_TAGS, MARGIN_M = 0.97, 0.1
RATE_MPS = 0.2


class SightCheck:
    """The camera and the radar, and what they have to see. other_m: how far away the other vehicle is."""

    def __init__(self, step_s: float, other_m: float) -> None:
        self.camera, self.radar = CarlaCamera(CAMERA_KEYS, step_s), CarlaRadar(RADAR_KEYS, step_s)
        self._other_m = other_m

    def mounts(self) -> Mapping[str, tuple[Float64, Mapping[str, object]]]:
        """base_SE3_sensor and attributes by blueprint."""
        return {
            blueprint: (sensor.base_SE3_sensor, attributes)
            for sensor in (self.camera, self.radar)
            for blueprint, attributes in sensor.attributes.items()
        }

    def pictures(self, data: Mapping[str, Any], own: int, other: int, map_SE3_base: Float64) -> str:
        """Of the numbers and the depth of the other vehicle's pixels. own, other: the actors' numbers."""
        images = {blueprint: data[blueprint] for blueprint in self.camera.attributes}
        layers = self.camera.picture(images, Boxes(), np.zeros(0, np.int64), map_SE3_base).layers
        instances, tags = _pixels(data[INSTANCE]), _pixels(data[SEMANTIC])[:, 2]
        seen = np.flatnonzero(seen_objects(instances, np.array([own, other])) == 1)
        found = instances[np.isin(instances[:, 2], ROAD_USERS)].astype(np.int64)
        numbers = sorted({int(each) for each in found[:, 1] + 256 * found[:, 0]})[:5]
        require(
            len(seen) >= FEWEST_PIXELS,
            f"{len(seen)} pixels have the number of the vehicle to the right, {other & 0xFFFF}; "
            f"those of road users have {numbers}",
        )
        column = float(np.mean(seen % CAMERA_KEYS.image_size_x))
        middle = CAMERA_KEYS.image_size_x / 2
        require(column > middle, f"the vehicle to the right is left of the middle, in column {column:.0f}")
        away_m = float(np.median(layers.range_m[seen]))
        near = self._other_m - 3 < away_m < self._other_m + 3
        require(near, f"the vehicle {self._other_m:g} m to the right is {away_m:.1f} m away by its depth")
        same = float((tags == instances[:, 2]).mean())
        require(same > SAME_TAGS, f"only {same:.0%} of the tags are those of the semantic camera")
        grey = _pixels(data[RGB])[:, :3].astype(float)
        require(grey.std() > 2, f"the picture is of one colour, {grey.mean():.0f} of 255")
        return (
            f"{len(seen)} pixels on it, {away_m:.1f} m away, {same:.1%} of the tags as in the semantic one; "
            f"grey {grey.mean():.0f} of 255 on average"
        )

    def hits(self, data: Any, own: Boxes, other: Boxes, map_SE3_base: Float64, base_mps: Float64) -> str:
        """Of the sides and the sign of velocities, while the vehicle moves with base_mps (3,) in its axes."""
        hits = self.radar.hits(data, own, other, map_SE3_base, None)
        require(len(hits) > 0, "the radar hits nothing but its own vehicle")
        radar_mps = self.radar.base_SE3_sensor[:3, :3].T @ base_mps
        computed = self.radar.hits(data, own, other, map_SE3_base, radar_mps)
        level_m = hits[:, 0] * np.cos(hits[:, 2])
        place_m = level_m * np.cos(hits[:, 1]), level_m * np.sin(hits[:, 1]), hits[:, 0] * np.sin(hits[:, 2])
        points_m = transform_points(map_SE3_base @ self.radar.base_SE3_sensor, np.stack(place_m, axis=1))
        (on_other,) = points_in_boxes(points_m, other.geometry, MARGIN_M)
        require(
            len(on_other) >= FEWEST_HITS,
            f"{len(on_other)} hits of {len(hits)} are on the vehicle to the right",
        )
        off = {sign: float(np.median(np.abs(sign * hits[:, 3] - computed[:, 3]))) for sign in (1, -1)}
        require(
            off[1] < RATE_MPS,
            f"velocities are {off[1]:.2f} m/s off"
            + (": positive ones come nearer, against what its source says" if off[-1] < RATE_MPS else ""),
        )
        return (
            f"{len(on_other)} of {len(hits)} hits on it, {np.median(hits[on_other, 0]):.1f} m away; "
            f"velocities {off[1]:.3f} m/s off, positive ones move away"
        )


def _pixels(image: Any) -> npt.NDArray[np.uint8]:
    return np.frombuffer(image.raw_data, np.uint8).reshape(-1, 4)
