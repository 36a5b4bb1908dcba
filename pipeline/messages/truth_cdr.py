"""The ground truth of one instant in CDR, written field by field, which is faster than objects of messages.

See `build` and `markers` for what the messages hold, and `cdr` for the bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.messages.cdr import Cdr
from advpipe.pipeline.messages.markers import CLASS_COLOURS_RGB, OPACITY, marker
from advpipe.pipeline.messages.types import serialise

_NO_COVARIANCE = bytes(36 * 8)
_DELETE_ALL, _ADD, _CUBE = 3, 0, 1


def detections_cdr(stamp_ns: int, frame_id: str, boxes: Boxes) -> bytes:
    """vision_msgs/Detection3DArray, see `build.detections_message`."""
    cdr = Cdr()
    cdr.header(stamp_ns, frame_id)
    cdr.uint32(len(boxes))
    for pose, size, label, name in zip(*_columns(boxes), boxes.ids, strict=True):
        cdr.header(stamp_ns, frame_id)
        cdr.uint32(1)
        cdr.string(CLASSES[label])
        cdr.float64(1.0, *pose)
        cdr.body += _NO_COVARIANCE
        cdr.float64(*pose, *size)
        cdr.string(name)
    return bytes(cdr)


def road_users_cdr(
    stamp_ns: int, frame_id: str, boxes: Boxes, lidar_points: npt.ArrayLike, occlusion: npt.ArrayLike
) -> bytes:
    """advpipe_msgs/RoadUserArray, see `build.road_users`."""
    cdr = Cdr()
    cdr.header(stamp_ns, frame_id)
    cdr.uint32(len(boxes))
    counts = np.asarray(lidar_points).astype(np.int64).tolist()
    hidden = np.asarray(occlusion, dtype=np.float64).tolist()
    for pose, size, label, name, velocity, points, occluded in zip(
        *_columns(boxes), boxes.ids, boxes.velocity_mps.tolist(), counts, hidden, strict=True
    ):
        cdr.string(name)
        cdr.string(CLASSES[label])
        cdr.float64(*pose, *size, *velocity)
        cdr.uint32(points)
        cdr.float32(occluded)
    return bytes(cdr)


def markers_cdr(stamp_ns: int, frame_id: str, boxes: Boxes) -> bytes:
    """visualization_msgs/MarkerArray, see `markers.markers`."""
    cdr = Cdr()
    cdr.uint32(len(boxes) + 1)
    _add_marker(cdr, stamp_ns, frame_id, ("", 0, 0, _DELETE_ALL), (0.0,) * 6 + (1.0,), (0.0,) * 3)
    cdr.float32(0.0, 0.0, 0.0, 0.0)
    cdr.body += _marker_end()
    for number, (pose, size, label) in enumerate(zip(*_columns(boxes), strict=True)):
        name = CLASSES[label]
        _add_marker(cdr, stamp_ns, frame_id, (name, number, _CUBE, _ADD), pose, size)
        cdr.float32(*CLASS_COLOURS_RGB[name], OPACITY)
        cdr.body += _marker_end()
    return bytes(cdr)


def _add_marker(
    cdr: Cdr,
    stamp_ns: int,
    frame_id: str,
    what: tuple[str, int, int, int],
    pose: Sequence[float],
    size: Sequence[float],
) -> None:
    """visualization_msgs/Marker up to its scale; what: its namespace, number, type and action."""
    cdr.header(stamp_ns, frame_id)
    cdr.string(what[0])
    cdr.uint32(*what[1:])
    cdr.float64(*pose, *size)


@cache
def _marker_end() -> bytes:
    """The fields after the colour at their defaults; none needs more than the colour's alignment."""
    whole = serialise(marker(0, ""), "visualization_msgs/msg/Marker")
    cdr = Cdr()
    _add_marker(cdr, 0, "", ("", 0, 0, 0), (0.0,) * 6 + (1.0,), (0.0,) * 3)
    return whole[len(bytes(cdr)) + 16 :]


def _columns(boxes: Boxes) -> tuple[list[tuple[float, ...]], list[list[float]], list[int]]:
    """The poses (x, y, z and quaternion), sizes and labels of boxes."""
    half_yaw = boxes.geometry[:, 6] / 2
    poses = np.zeros((len(boxes), 7))
    poses[:, :3] = boxes.geometry[:, :3]
    poses[:, 5], poses[:, 6] = np.sin(half_yaw), np.cos(half_yaw)
    return list(map(tuple, poses.tolist())), boxes.geometry[:, 3:6].tolist(), boxes.labels.tolist()
