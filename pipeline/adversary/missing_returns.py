"""How many returns may be removed from each part of a cloud before the density check would notice."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.density import QUANTILE, WINDOW, LossModel
from advpipe.pipeline.attack_detection.range_image import RangeImage
from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.messages.cloud import Cloud

Int64 = npt.NDArray[np.int64]

MARGIN = 0.85
"""Of the excess that the windows of the clean cloud reach: the defender's losses are learnt elsewhere."""


class MissingReturnLimit:
    """The room for removals in each window of one clean cloud (N,), all of whose points are finite.

    No window that is below the clean cloud's own score comes near to it, so that the score of the attacked
    cloud is hardly higher. The losses are learnt from the cloud itself.
    """

    def __init__(self, cloud: Cloud, sensor: SensorGeometry) -> None:
        image = RangeImage.of(cloud, sensor)
        self._ray, self._columns = image.ray, image.count.shape[1]
        missing, spread = LossModel.learnt([image]).windows(image)
        limit = MARGIN * float(np.quantile(missing / spread, QUANTILE))
        self._clean_room = np.maximum(limit * spread - missing, 0.0)
        self._room = self._clean_room.copy()

    def start(self, removed: Int64) -> None:
        """Begin with these points (K,) removed, whether there is room for them or not."""
        self._room = self._clean_room.copy()
        for point in removed.tolist():
            self._window(point, -1.0)

    def take(self, points: Int64) -> bool:
        """Remove these points (K,) if there is room for all of them; whether there is."""
        for number, point in enumerate(points.tolist()):
            if self._window(point, -1.0) < 0:
                for taken in points[: number + 1].tolist():
                    self._window(taken, 1.0)
                return False
        return True

    def _window(self, point: int, change: float) -> float:
        """Change the room of all windows that hold a point; the least that is left of it."""
        row, column = divmod(int(self._ray[point]), self._columns)
        rows = slice(max(row - WINDOW[0] // 2, 0), row + WINDOW[0] // 2 + 1)
        columns = np.arange(column - WINDOW[1] // 2, column + WINDOW[1] // 2 + 1) % self._columns
        left = self._room[rows, columns] + change
        self._room[rows, columns] = left
        return float(left.min())
