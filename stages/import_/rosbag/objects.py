"""Boxes of ROS messages: those of vision_msgs, derived_object_msgs, Autoware, jsk, and cubes of markers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from advpipe.pipeline.bag.ground_truth import SOLID_BOX
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64, se3, yaw_of
from advpipe.pipeline.messages.build import se3_from_pose
from advpipe.stages.import_.named_boxes import NamedBox

MARKERS = "visualization_msgs/msg/MarkerArray"
_CUBE, _ADDED = 1, 0

_DERIVED_CLASSES = {
    **dict.fromkeys(range(4), "unknown"),
    **{4: "pedestrian", 5: "bicycle", 6: "car", 7: "truck", 8: "motorcycle", 9: "other_vehicle"},
    **{10: "barrier", 11: "sign"},
}
"""By `classification` of derived_object_msgs/Object."""

_AUTOWARE_CLASSES = (
    *("unknown", "car", "truck", "bus", "trailer", "motorcycle", "bicycle", "pedestrian"),
    *("animal", "hazard", "over_drivable", "under_drivable"),
)
_AUTOWARE_POLYGON = 2
_NO_VELOCITY = np.full(3, np.nan)


@dataclass(frozen=True)
class PosedBox:
    """A box in a frame of the recording. size_m: (3,) length, width, height.

    velocity_mps: (3,) along the axes of that frame, NaN where unknown.
    """

    class_name: str
    id: str
    frame_id: str
    frame_SE3_box: Float64
    size_m: Float64
    velocity_mps: Float64

    def raised(self) -> PosedBox:
        """The box whose bottom is where this one's centre is."""
        up = se3(np.eye(3), (0.0, 0.0, self.size_m[2] / 2))
        return replace(self, frame_SE3_box=self.frame_SE3_box @ up)

    def in_frame(self, a_SE3_frame: Float64, later_s: float = 0.0) -> NamedBox:
        """The upright box in another frame, so much later if its velocity is known."""
        moved_m = self.velocity_mps * later_s if np.isfinite(self.velocity_mps).all() else np.zeros(3)
        a_SE3_box = a_SE3_frame @ se3(np.eye(3), moved_m) @ self.frame_SE3_box
        box = (*a_SE3_box[:3, 3], *self.size_m, yaw_of(a_SE3_box))
        velocity_mps = tuple(a_SE3_frame[:3, :3] @ self.velocity_mps)
        return NamedBox(self.class_name, box, self.id, velocity_mps)


def boxes_of_message(message: Any, type_name: str) -> list[PosedBox]:
    """The boxes of a message of one of `BOX_READERS`. Raises AdvpipeError."""
    try:
        return list(BOX_READERS[type_name](message))
    except (AttributeError, ValueError, TypeError, IndexError) as error:
        raise AdvpipeError(f"it cannot be understood as {type_name}: {error}") from None


def _xyz(vector: Any) -> Float64:
    return np.array([vector.x, vector.y, vector.z], np.float64)


def _vision(message: Any) -> Iterator[PosedBox]:
    """Of any release: class and score are in `hypothesis` since 3.0, the id was `tracking_id` before."""
    for each in message.detections:
        results = [getattr(result, "hypothesis", result) for result in each.results]
        best = max(results, key=lambda result: float(result.score), default=None)
        class_name = "unknown" if best is None else str(getattr(best, "class_id", getattr(best, "id", "")))
        name = str(getattr(each, "id", getattr(each, "tracking_id", "")))
        pose, size = se3_from_pose(each.bbox.center), _xyz(each.bbox.size)
        yield PosedBox(class_name, name, message.header.frame_id, pose, size, _NO_VELOCITY)


def _derived(message: Any) -> Iterator[PosedBox]:
    for each in message.objects:
        if each.shape.type != SOLID_BOX or len(each.shape.dimensions) != 3:
            raise ValueError(f"the object {each.id} is not a box")
        yield PosedBox(
            _DERIVED_CLASSES.get(each.classification, "unknown"),
            str(each.id),
            message.header.frame_id or each.header.frame_id,
            se3_from_pose(each.pose),
            np.asarray(each.shape.dimensions, np.float64),
            _xyz(each.twist.linear),
        )


def _autoware(message: Any) -> Iterator[PosedBox]:
    for each in message.objects:
        if each.shape.type == _AUTOWARE_POLYGON:
            raise ValueError("an object is a polygon, not a box")
        best = max(each.classification, key=lambda one: float(one.probability), default=None)
        label = 0 if best is None else int(best.label)
        class_name = _AUTOWARE_CLASSES[label] if label < len(_AUTOWARE_CLASSES) else "unknown"
        uuid = getattr(each, "object_id", None)
        pose = se3_from_pose(each.kinematics.pose_with_covariance.pose)
        velocity = pose[:3, :3] @ _xyz(each.kinematics.twist_with_covariance.twist.linear)
        yield PosedBox(
            class_name,
            "" if uuid is None else bytes(uuid.uuid).hex(),
            message.header.frame_id,
            pose,
            _xyz(each.shape.dimensions),
            velocity if getattr(each.kinematics, "has_twist", True) else _NO_VELOCITY,
        )


def _jsk(message: Any) -> Iterator[PosedBox]:
    """Classes are numbers, whose meaning the user has to say."""
    for each in message.boxes:
        frame_id = each.header.frame_id or message.header.frame_id
        pose, size = se3_from_pose(each.pose), _xyz(each.dimensions)
        yield PosedBox(str(each.label), "", frame_id, pose, size, _NO_VELOCITY)


def _cubes(message: Any) -> Iterator[PosedBox]:
    """Their namespaces stand for classes."""
    for each in message.markers:
        if each.type == _CUBE and each.action == _ADDED:
            pose, size = se3_from_pose(each.pose), _xyz(each.scale)
            yield PosedBox(each.ns, str(each.id), each.header.frame_id, pose, size, _NO_VELOCITY)


BOX_READERS: Mapping[str, Callable[[Any], Iterator[PosedBox]]] = {
    "vision_msgs/msg/Detection3DArray": _vision,
    "derived_object_msgs/msg/ObjectArray": _derived,
    "jsk_recognition_msgs/msg/BoundingBoxArray": _jsk,
    **{
        f"{package}/msg/{name}": _autoware
        for package in ("autoware_perception_msgs", "autoware_auto_perception_msgs")
        for name in ("DetectedObjects", "TrackedObjects")
    },
    MARKERS: _cubes,
}
"""By message type; markers are read only where they are asked for."""
