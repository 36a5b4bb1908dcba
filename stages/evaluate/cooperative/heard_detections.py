"""What a vehicle hears of in CPMs, as detections around its LiDAR."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.heard_objects import heard_objects_of_message
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.evaluate.cooperative.heard_scenes import box_in_lidar

HEARD_SCORE = 0.3
"""CPMs here state no confidence. So the vehicle's own detections of at least this score come first."""
NEWEST_NS = 200_000_000
"""Maps are recorded ten times a second: an older one is none."""


class HeardDetections:
    """The objects of a vehicle's recorded maps. classes: of the detector whose detections they join."""

    def __init__(self, reader: BagReader, topics: VehicleTopics, classes: Sequence[str]) -> None:
        self._reader, self._topic = reader, topics.heard_objects.name
        self._labels = {name: label for label, name in enumerate(classes)}

    def at(self, stamp_ns: int, lidar_SE3_map: Float64) -> Detections:
        """Those of the newest map at a stamp, where they are by then, in the LiDAR's frame.

        Objects without a size, and of classes that the detector does not know, are left out.
        """
        boxes, labels = [], []
        newest = None
        for raw in self._reader.raw_messages([self._topic], stamp_ns - NEWEST_NS, stamp_ns):
            newest = raw
        heard = () if newest is None else heard_objects_of_message(self._reader.decode(newest))
        for one in heard:
            box = box_in_lidar(one, stamp_ns, lidar_SE3_map)
            if box is not None and one.label in self._labels:
                boxes.append(box)
                labels.append(self._labels[one.label])
        return Detections(
            np.array(boxes, np.float64).reshape(-1, 7),
            np.full(len(boxes), HEARD_SCORE),
            np.array(labels, np.int64),
        )
