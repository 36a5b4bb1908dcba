"""A ghost object: a road user that does not exist and that an attack makes the detector find."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes

SIZES_M = {
    "car": (4.5, 1.85, 1.55),
    "truck": (6.0, 2.2, 2.6),
    "cyclist": (1.9, 0.75, 1.7),
    "pedestrian": (0.8, 0.7, 1.75),
}
"""Length, width and height of a ghost object of each class."""

GROUND_RADIUS_M = 3.0
_GROUND_PERCENTILE = 5


@dataclass(frozen=True)
class GhostObject:
    """A box of one of `geometry.boxes.CLASSES`, on the ground at a place in the cloud's frame."""

    name: str
    x_m: float
    y_m: float
    yaw_rad: float = 0.0

    def __post_init__(self) -> None:
        if self.name not in CLASSES:
            raise UsageError(f"ghost: unknown class {self.name!r}; known: {', '.join(CLASSES)}")
        for place in fields(self)[1:]:
            if not math.isfinite(getattr(self, place.name)):
                raise UsageError(f"ghost: {place.name} is {getattr(self, place.name)}, but must be finite")

    @staticmethod
    def parse(text: str) -> GhostObject:
        """Parse `CLASS:X:Y` or `CLASS:X:Y:YAW`, in metres and radians, such as `car:12:-3.5`."""
        name, *numbers = text.split(":")
        try:
            if not 2 <= len(numbers) <= 3:
                raise ValueError
            return GhostObject(name, *map(float, numbers))
        except ValueError:
            raise UsageError(f"ghost is {text!r}, but must read CLASS:X:Y or CLASS:X:Y:YAW") from None

    def check(self, detector: ObjectDetector) -> None:
        """Raises AdvpipeError if it is not of the detector's classes or lies outside of its range."""
        if self.name not in detector.classes:
            known = ", ".join(detector.classes)
            raise UsageError(f"ghost: the detector finds no {self.name}; it finds {known}")
        seen = detector.range_m
        if not seen.contains_centres(np.array([[self.x_m, self.y_m]])).all():
            raise UsageError(
                f"ghost: ({self.x_m:g}, {self.y_m:g}) m lies outside of the detector's range, "
                f"x {seen.x_min_m:g} to {seen.x_max_m:g} m and y {seen.y_min_m:g} to {seen.y_max_m:g} m "
                "from the LiDAR"
            )

    def boxes(self, points: npt.NDArray[np.float32]) -> Boxes:
        """Its box as `Boxes` of one; none if the cloud (N, 3) has no ground points near its place."""
        near = np.hypot(points[:, 0] - self.x_m, points[:, 1] - self.y_m) < GROUND_RADIUS_M
        if not near.any():
            return Boxes()
        size_m = SIZES_M[self.name]
        ground_m = float(np.percentile(points[near, 2], _GROUND_PERCENTILE))
        box = [self.x_m, self.y_m, ground_m + size_m[2] / 2, *size_m, self.yaw_rad]
        label = np.array([CLASSES.index(self.name)], np.int64)
        return Boxes(np.array([box]), label, ("ghost",), np.zeros((1, 3)))
