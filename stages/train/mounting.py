"""Changes of a training frame that another mount of the LiDAR or other ground would bring about.

Real clouds differ from level ones most in height: cars stand up to 0.4 m higher or lower than expected, as
streets rise and fall, and as loads and kerbs tilt the vehicle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3, se3_from_tilt, transform_points
from advpipe.stages.train.config import Augmentation
from advpipe.stages.train.frames import TrainingFrame, transformed

CREASE_M = (4.0, 40.0)
"""How far from the sensor sloping ground begins."""


def remount(frame: TrainingFrame, config: Augmentation, rng: np.random.Generator) -> TrainingFrame:
    """The frame on sloping ground, from a tilted and higher or lower sensor; some frames stay as they are.

    Boxes stay upright, with their centres on the changed ground.
    """
    change = rng.random() < config.remounted
    slope_rad = rng.uniform(-config.slope_rad, config.slope_rad)
    tilt_rad = rng.uniform(-config.tilt_rad, config.tilt_rad)
    height_m = rng.uniform(-config.height_m, config.height_m)
    bearing_rad, axis_rad = rng.uniform(-np.pi, np.pi, 2)
    begins_m = rng.uniform(*CREASE_M)
    if not change:
        return frame
    frame = slope(frame, slope_rad, bearing_rad, begins_m)
    frame = tilt(frame, tilt_rad, axis_rad)
    return _moved(frame, se3(np.eye(3), (0.0, 0.0, height_m)))


def slope(frame: TrainingFrame, slope_rad: float, bearing_rad: float, begins_m: float) -> TrainingFrame:
    """The frame with ground that rises by `slope_rad` in one direction, beyond a distance."""
    ahead = np.array([np.cos(bearing_rad), np.sin(bearing_rad)])

    def risen(places: Float64) -> Float64:
        new = places.copy()
        new[:, 2] += np.tan(slope_rad) * np.maximum(places[:, :2] @ ahead - begins_m, 0)
        return new

    points = risen(frame.points.astype(np.float64)).astype(np.float32)
    return replace(frame, points=points, boxes=risen(frame.boxes), ignored=risen(frame.ignored))


def tilt(frame: TrainingFrame, tilt_rad: float, axis_rad: float) -> TrainingFrame:
    """The frame from a sensor that is tilted about a level axis."""
    return _moved(frame, se3_from_tilt(tilt_rad, axis_rad))


def _moved(frame: TrainingFrame, new_SE3_old: Float64) -> TrainingFrame:
    """The frame in another frame of reference; headings stay."""

    def moved(boxes: Float64) -> Float64:
        new = boxes.copy()
        new[:, :3] = transform_points(new_SE3_old, boxes[:, :3])
        return new

    return replace(
        frame,
        points=transformed(frame.points, new_SE3_old),
        boxes=moved(frame.boxes),
        ignored=moved(frame.ignored),
        coverage=frame.coverage.transformed(new_SE3_old),
    )
