"""Message types that recordings in SQLite name without defining them and that rosbags does not know."""

from __future__ import annotations

from functools import cache

from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from advpipe.pipeline.messages.types import typestore

_POSE_TWIST = (
    "geometry_msgs/PoseWithCovariance pose_with_covariance\n{between}"
    "geometry_msgs/TwistWithCovariance twist_with_covariance\n"
)

DEFINITIONS = {
    "derived_object_msgs/msg/Object": (
        "std_msgs/Header header\nuint32 id\nuint8 detection_level\nbool object_classified\n"
        "geometry_msgs/Pose pose\ngeometry_msgs/Twist twist\ngeometry_msgs/Accel accel\n"
        "geometry_msgs/Polygon polygon\nshape_msgs/SolidPrimitive shape\nuint8 classification\n"
        "uint8 classification_certainty\nuint32 classification_age\n"
    ),
    "derived_object_msgs/msg/ObjectArray": ("std_msgs/Header header\nderived_object_msgs/Object[] objects\n"),
    "autoware_perception_msgs/msg/ObjectClassification": "uint8 label\nfloat32 probability\n",
    "autoware_perception_msgs/msg/Shape": (
        "uint8 type\ngeometry_msgs/Polygon footprint\ngeometry_msgs/Vector3 dimensions\n"
    ),
    "autoware_perception_msgs/msg/DetectedObjectKinematics": (
        _POSE_TWIST.format(between="bool has_position_covariance\nuint8 orientation_availability\n")
        + "bool has_twist\nbool has_twist_covariance\n"
    ),
    "autoware_perception_msgs/msg/TrackedObjectKinematics": (
        _POSE_TWIST.format(between="")
        + "geometry_msgs/AccelWithCovariance acceleration_with_covariance\n"
        + "uint8 orientation_availability\nbool is_stationary\n"
    ),
    "autoware_perception_msgs/msg/DetectedObject": (
        "float32 existence_probability\nautoware_perception_msgs/ObjectClassification[] classification\n"
        "autoware_perception_msgs/DetectedObjectKinematics kinematics\n"
        "autoware_perception_msgs/Shape shape\n"
    ),
    "autoware_perception_msgs/msg/TrackedObject": (
        "unique_identifier_msgs/UUID object_id\nfloat32 existence_probability\n"
        "autoware_perception_msgs/ObjectClassification[] classification\n"
        "autoware_perception_msgs/TrackedObjectKinematics kinematics\n"
        "autoware_perception_msgs/Shape shape\n"
    ),
    "autoware_perception_msgs/msg/DetectedObjects": (
        "std_msgs/Header header\nautoware_perception_msgs/DetectedObject[] objects\n"
    ),
    "autoware_perception_msgs/msg/TrackedObjects": (
        "std_msgs/Header header\nautoware_perception_msgs/TrackedObject[] objects\n"
    ),
}
"""The fields of each type, without comments and constants, which are not part of a message."""


@cache
def known_types() -> Typestore:
    """The types of ROS 2 Humble's common packages, advpipe's own, and those above."""
    store = Typestore()
    store.register(typestore().fielddefs)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store
