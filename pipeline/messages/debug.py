"""Debug topics: what an attack did, for viewers. They give the attack away, so that no input may read them.

The debug topic of an attacked topic has its name after `/advpipe/debug`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.messages.build import pose, vector3
from advpipe.pipeline.messages.cloud import points_to_cdr
from advpipe.pipeline.messages.markers import colour, marker
from advpipe.pipeline.messages.topics import MAP_FRAME
from advpipe.pipeline.messages.types import message_class, serialise

DEBUG_PREFIX = "/advpipe/debug"

TOUCHED_POINT_DTYPE = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<f4"), ("displacement_m", "<f4"), ("action", "u1")]
)
"""One touched point, 21 bytes: metres in the LiDAR's frame; the colour 0x00RRGGBB in the bits of a float, as
PCL has it; how far the point was moved, or an added one lies from the nearest clean point, NaN if removed;
the action, which counts `TOUCHED_COLOURS_RGB` from 1."""

TOUCHED_COLOURS_RGB = {"removed": 0xE33D3D, "moved": 0xFFB000, "added": 0x00C8FF}
"""Colour of each action of `labels.points.ACTIONS`. Removed points are shown at their clean position, moved
and added ones at their new position."""

TRUE, FALSE, BELIEVED, NOT_SENT = "true", "false", "believed", "not sent"
"""The role of a position. Not sent: of a message that an attack dropped, or holds back to send it later."""

_ROLE_COLOURS_RGB = {
    TRUE: (0.17, 0.63, 0.17),
    FALSE: (0.89, 0.24, 0.24),
    BELIEVED: (1.0, 0.69, 0.0),
    NOT_SENT: (0.6, 0.6, 0.6),
}
MOST_CLAIMS = 200
"""Claimed positions in one message, at most: the newest ones of a step."""

LIFETIME_S = 1
"""How long a marker stays, unless the next one of its claim replaces it."""

_SPHERE_M, _LINE_M, _TEXT_M = 1.5, 0.2, 1.0
MOST_ID = 2**31


def is_debug(topic_name: str) -> bool:
    """Whether a topic shows what an attack did."""
    return topic_name.startswith(f"{DEBUG_PREFIX}/")


def touched_points_topic(lidar_topic: str) -> Topic:
    """The topic of the points that an attack touched in the clouds of a LiDAR's topic."""
    return Topic(f"{DEBUG_PREFIX}{lidar_topic}", "sensor_msgs/msg/PointCloud2", keep_last(5))


def positions_topic(attacked_topic: str) -> Topic:
    """The topic of true, false and believed positions that belong to an attacked topic."""
    return Topic(f"{DEBUG_PREFIX}{attacked_topic}", "visualization_msgs/msg/MarkerArray", keep_last(100))


def touched_points(
    xyz_m: npt.NDArray[np.float32], action: str, displacement_m: npt.NDArray[np.float64]
) -> npt.NDArray[np.void]:
    """Points (K,) of `TOUCHED_POINT_DTYPE` from positions (K, 3), their action and displacements (K,)."""
    points = np.zeros(len(xyz_m), TOUCHED_POINT_DTYPE)
    points["x"], points["y"], points["z"] = xyz_m.T
    points["displacement_m"] = displacement_m
    points["action"] = 1 + list(TOUCHED_COLOURS_RGB).index(action)
    points["rgb"] = np.uint32(TOUCHED_COLOURS_RGB[action]).view(np.float32)
    return points


def touched_points_cdr(points: npt.NDArray[np.void], stamp_ns: int, frame_id: str) -> bytes:
    """Serialise points (K,) of `TOUCHED_POINT_DTYPE` as sensor_msgs/PointCloud2."""
    is_dense = bool(all(np.isfinite(points[axis]).all() for axis in "xyz"))
    return points_to_cdr(points, stamp_ns, frame_id, is_dense)


@dataclass(frozen=True)
class ClaimedPosition:
    """A station or vehicle under attack. id: of the one that it claims to be. label: shown beside it.

    positions_m: (3,) in the map by role, as far as there are such positions.
    """

    id: int
    label: str
    positions_m: Mapping[str, Float64]


def positions_cdr(stamp_ns: int, claims: Sequence[ClaimedPosition]) -> bytes:
    """Serialise a visualization_msgs/MarkerArray: spheres, lines from the true position, labels.

    Each marker replaces the claim's previous one, and vanishes after a second.
    """
    Marker, Point = message_class("visualization_msgs/msg/Marker"), message_class("geometry_msgs/msg/Point")
    lifetime = message_class("builtin_interfaces/msg/Duration")(sec=LIFETIME_S, nanosec=0)
    shown = []
    for claim in claims:
        own = {"action": Marker.ADD, "id": claim.id % MOST_ID, "lifetime": lifetime}
        for role, position_m in claim.positions_m.items():
            place, paint = np.eye(4), colour(_ROLE_COLOURS_RGB[role])
            place[:3, 3] = position_m
            sphere = {"type": Marker.SPHERE, "pose": pose(place), "scale": vector3([_SPHERE_M] * 3)}
            shown.append(marker(stamp_ns, MAP_FRAME, ns=role, color=paint, **own, **sphere))
            if role == TRUE:
                continue
            place[2, 3] += _SPHERE_M
            text = {"type": Marker.TEXT_VIEW_FACING, "pose": pose(place), "scale": vector3([0, 0, _TEXT_M])}
            label = f"{claim.label}: {role}"
            shown.append(
                marker(stamp_ns, MAP_FRAME, ns=f"{role} label", color=paint, text=label, **own, **text)
            )
            if TRUE in claim.positions_m:
                ends = [claim.positions_m[TRUE], position_m]
                points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in ends]
                line = {"type": Marker.LINE_STRIP, "scale": vector3([_LINE_M, 0, 0]), "points": points}
                shown.append(marker(stamp_ns, MAP_FRAME, ns=f"true to {role}", color=paint, **own, **line))
    array = message_class("visualization_msgs/msg/MarkerArray")(markers=shown)
    return serialise(array, "visualization_msgs/msg/MarkerArray")


@dataclass(frozen=True)
class MarkedPosition:
    """A position (3,) in the map that a debug topic shows. id: of a claim. label: empty for a true one."""

    role: str
    id: int
    position_m: Float64
    label: str


def marked_positions(message: Any) -> list[MarkedPosition]:
    """The positions in a visualization_msgs/MarkerArray of `positions_cdr`; other markers are left out."""
    roles = {f"{role} label": role for role in _ROLE_COLOURS_RGB}
    labels = {(roles.get(each.ns), each.id): each.text for each in message.markers}
    return [
        MarkedPosition(each.ns, each.id, np.array([at.x, at.y, at.z]), labels.get((each.ns, each.id), ""))
        for each in message.markers
        if each.ns in _ROLE_COLOURS_RGB and (at := each.pose.position)
    ]
