"""Lines on the map: lanes, and where vehicles truly went and believed to be."""

from __future__ import annotations

import threading
from collections import defaultdict

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.messages.markers import lanes_of_markers
from advpipe.pipeline.messages.topics import LANES, MAP_FRAME, VehicleTopics
from advpipe.pipeline.viewer.scene import BELIEVED_PATH, LANE, TRUE_PATH, SceneLine

ODOMETRY = "nav_msgs/msg/Odometry"

STEP_M = 10.0
"""The longest part of a lane: a straight one may have only its two ends, both far away."""


def read_lanes(reader: BagReader) -> list[Float64]:
    """The middles (K, 3) of the lanes on the map, in steps of at most `STEP_M`; none without lanes."""
    if LANES.name not in reader.topics or reader.topics[LANES.name].type != LANES.type:
        return []
    middles = [
        middle_m for _, message in reader.messages(LANES.name) for middle_m, _ in lanes_of_markers(message)
    ]
    return [_in_steps(middle_m) for middle_m in middles if len(middle_m) > 1 and np.isfinite(middle_m).all()]


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


def on_ground(kind: str, map_m: Float64, lidar_SE3_map: Float64, condition: str = "") -> SceneLine:
    """Places (K, 3) of the map as a line in the LiDAR's frame."""
    return SceneLine(kind, transform_points(lidar_SE3_map, map_m), condition)


def lane_lines(lanes: list[Float64], lidar_SE3_map: Float64) -> list[SceneLine]:
    """The lanes in the LiDAR's frame."""
    return [on_ground(LANE, middle_m, lidar_SE3_map) for middle_m in lanes]


def _in_steps(line: Float64) -> Float64:
    """The same line (K, 3), with places in between."""
    ways_m = np.linalg.norm(np.diff(line, axis=0), axis=1)
    along_m = np.concatenate([[0.0], np.cumsum(ways_m)])
    steps_m = np.arange(0.0, min(along_m[-1], 1e5), STEP_M)
    at_m = np.union1d(along_m, steps_m)
    return np.stack([np.interp(at_m, along_m, line[:, axis]) for axis in range(3)], axis=1)
