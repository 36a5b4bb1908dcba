"""The same drive, recorded by a LiDAR that is mounted higher, tilted, or gives intensities from 0 to 255."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.transforms import Float64, invert, se3_from_yaw, transform_points
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import StampedCloud, cloud_to_cdr, xyz
from advpipe.pipeline.messages.topics import TF_STATIC
from advpipe.pipeline.messages.types import serialise


def record_raised(
    clean: Path, out: Path, up_m: float = 0.0, pitch_rad: float = 0.0, intensity: float = 1.0
) -> Path:
    """Writes the bag: clouds, and the mount on /tf_static; the truth is in another frame."""
    reader = BagReader(clean)
    old_SE3_new = se3_from_yaw((0.0, 0.0, up_m), 0.0, pitch_rad)
    with BagWriter(out, provenance=dict(reader.provenance)) as bag:
        for raw in reader.raw_messages():
            if raw.topic.type == "sensor_msgs/msg/PointCloud2":
                raw = replace(raw, cdr=_seen_from(reader.cloud(raw), old_SE3_new, intensity))
            elif raw.topic.name == TF_STATIC.name:
                raw = replace(raw, cdr=_remounted(reader.decode(raw), old_SE3_new))
            bag.copy(raw)
    return out


def _seen_from(stamped: StampedCloud, old_SE3_new: Float64, intensity: float) -> bytes:
    cloud = stamped.cloud.copy()
    cloud["x"], cloud["y"], cloud["z"] = transform_points(invert(old_SE3_new), xyz(cloud)).T
    cloud["intensity"] *= np.float32(intensity)
    return cloud_to_cdr(cloud, stamped.stamp_ns, stamped.frame_id)


def _remounted(message: Any, old_SE3_new: Float64) -> bytes:
    found = [
        (one.header.frame_id, one.child_frame_id, build.se3_from_transform(one.transform))
        for one in message.transforms
    ]
    mounts = [
        (parent, child, pose @ old_SE3_new if child.endswith("/lidar") else pose)
        for parent, child, pose in found
    ]
    return serialise(build.transforms(build.stamp_ns(message.transforms[0]), mounts), TF_STATIC.type)
