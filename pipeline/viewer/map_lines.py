"""What lies on the map as lines in the LiDAR's frame: lanes, and paths."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.messages.markers import lanes_of_markers
from advpipe.pipeline.messages.topics import LANES
from advpipe.pipeline.viewer.scene import LANE, SceneLine

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
