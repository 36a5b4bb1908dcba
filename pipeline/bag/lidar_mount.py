"""How a LiDAR is mounted, as /tf_static says: its pose above `base_link`, which is on the ground."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import TF_STATIC

GROUND_FRAMES = ("base_footprint", "base_link")
"""Frames on the ground below a vehicle, the surer one first; `vehicle/base_link` is one, too."""


def base_link_SE3_lidar(reader: BagReader, lidar_frame: str) -> Float64 | None:
    """The LiDAR's pose (4, 4) above the ground; None where the bag does not say it."""
    if TF_STATIC.name not in reader.topics:
        return None
    parents = {
        one.child_frame_id: (one.header.frame_id, build.se3_from_transform(one.transform))
        for _, message in reader.messages(TF_STATIC.name)
        for one in message.transforms
    }
    known: dict[str, Float64] = {}
    frame, frame_SE3_lidar = lidar_frame, np.eye(4)
    for _ in range(len(parents) + 1):  # a tree has no longer path; a loop ends here
        known.setdefault(frame.rpartition("/")[2], frame_SE3_lidar)
        if frame not in parents:
            break
        frame, parent_SE3_frame = parents[frame]
        frame_SE3_lidar = parent_SE3_frame @ frame_SE3_lidar
    return next((known[name] for name in GROUND_FRAMES if name in known), None)
