"""Where vehicles truly went, and where they believed to be."""

from __future__ import annotations

import threading
from collections import defaultdict

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics
from advpipe.pipeline.viewer.map_lines import on_ground
from advpipe.pipeline.viewer.scene import BELIEVED_PATH, TRUE_PATH, SceneLine

ODOMETRY = "nav_msgs/msg/Odometry"


class Paths:
    """Where each vehicle of a bag was on the map, by its topic of odometry.

    Reading a large bag takes a while: a thread does it, and `lines` gives what is known so far.
    """

    def __init__(self, bag: BagReader) -> None:
        kinds: dict[str, str] = {}
        known = bag.topics_of_type(ODOMETRY)
        for name in known:
            own = VehicleTopics(name.strip("/").split("/")[0])
            kinds |= {own.true_odometry.name: TRUE_PATH, own.odometry.name: BELIEVED_PATH}
        self._kinds = {name: kind for name, kind in kinds.items() if name in known}
        self._places: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
        self._thread = threading.Thread(target=self._read, args=(BagReader(bag.path),), daemon=True)

    def start(self, wait_s: float) -> None:
        """Begins to read, and waits for so long at most: a small bag is read by then."""
        self._thread.start()
        self._thread.join(wait_s)

    def _read(self, bag: BagReader) -> None:
        try:
            for raw in bag.raw_messages(list(self._kinds)):
                message = bag.decode(raw)
                if message.header.frame_id == MAP_FRAME:
                    at = message.pose.pose.position
                    self._places[raw.topic.name].append((at.x, at.y, at.z))
        except AdvpipeError:
            return  # a damaged bag: reading its frames reports the damage

    def lines(self, kind: str, lidar_SE3_map: Float64, condition: str = "") -> list[SceneLine]:
        """The paths of a kind as known by now, in the LiDAR's frame."""
        return [
            on_ground(kind, np.array(self._places[name][:]), lidar_SE3_map, condition)
            for name, found in self._kinds.items()
            if found == kind and self._places[name]
        ]
