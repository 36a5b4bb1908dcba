"""Shadow-Catcher (Hau et al., "Shadow-Catcher: Looking into Shadows to Detect Ghost Objects in Autonomous
Vehicle 3D Sensing", ESORICS 2021): behind a real object is a shadow without returns."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.base import DefenderKnowledge, Suspicion, worst
from advpipe.pipeline.attack_detection.sensor_geometry import Directions
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.geometry.transforms import wrap_angle
from advpipe.pipeline.messages.cloud import Cloud, xyz

Float64 = npt.NDArray[np.float64]

DECAY = 0.2
"""Weights halve with each such part of the way through a shadow, along it and across it."""

MAX_LENGTH_M = 40.0
"""Of the shadows of objects that are as high as the sensor."""

LOOKING_DOWN_RAD = np.deg2rad(-5.0)
"""Rays below this mostly return from the ground."""


class ShadowCatcherCheck:
    """Scores the returns in the shadow of each detection.

    The shadow lies behind the box, between the two lines from the sensor past its outermost corners, below
    the line over its top, and ends where that meets the ground. Each return in it weighs
    exp(ln(0.5) / 0.2 * x) for its way x along the shadow, and again for its way from the middle to the side,
    both in [0, 1]: returns deep behind an object or at its edge may be of something else. The score is the
    mean weight, scaled to [0, 1], and 0 without returns. The paper then asks a classifier of the clusters of
    returns which kind of attack it is; that is left out. It was made for spoofed objects of any class.
    """

    def __init__(self, knowledge: DefenderKnowledge) -> None:
        heights = []
        for cloud in knowledge.clean:
            way = Directions.of(cloud)
            is_ground = (way.elevation_rad < LOOKING_DOWN_RAD) & np.isfinite(way.range_m)
            heights.append(cloud["z"][is_ground])
        down = np.concatenate(heights)
        self._ground_m = float(np.median(down)) if len(down) else -np.inf

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        points = xyz(cloud).astype(np.float64)
        points = points[np.isfinite(points).all(axis=1)]
        flat_m = np.hypot(points[:, 0], points[:, 1])
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        where = (points[:, 2], flat_m, azimuth)
        scores = [shadow_score(*where, box, self._ground_m) for box in detections.boxes]
        return worst(np.array(scores))


def shadow_score(
    height_m: Float64, flat_m: Float64, azimuth_rad: Float64, box: Float64, ground_m: float
) -> float:
    """The score of a box (7,) over a ground of this height; of points (N,) the height, the distance in the
    plane and the azimuth, all from the sensor."""
    corners = box_corners(box[None])[0, :4, :2]
    corner_m = np.hypot(corners[:, 0], corners[:, 1])
    middle = np.arctan2(box[1], box[0])
    side = wrap_angle(np.arctan2(corners[:, 1], corners[:, 0]) - middle)
    first_m, top_m = float(corner_m.max()), float(box[2] + box[5] / 2)
    edge_m = first_m if top_m < 0 else float(corner_m.min())
    length_m = MAX_LENGTH_M
    if ground_m < top_m < 0:
        length_m = min(MAX_LENGTH_M, first_m * (ground_m / top_m - 1))
    centre, half = (side.max() + side.min()) / 2, (side.max() - side.min()) / 2
    across = np.abs(wrap_angle(azimuth_rad - middle) - centre) / max(half, 1e-9)
    along = (flat_m - first_m) / max(length_m, 1e-9)
    is_in = (across <= 1) & (along >= 0) & (along <= 1) & (height_m < top_m * flat_m / max(edge_m, 1e-9))
    if not is_in.any():
        return 0.0
    weight = np.exp(np.log(0.5) / DECAY * (across[is_in] + along[is_in]))
    least = np.exp(2 * np.log(0.5) / DECAY)
    return float((weight.mean() - least) / (1 - least))
