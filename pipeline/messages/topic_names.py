"""The names under which a drive's topics are published: advpipe's own, or those of another stack."""

from __future__ import annotations

import re
from collections.abc import Mapping

ADVPIPE, CARLA_ROS_BRIDGE = "advpipe", "carla_ros_bridge"

_NAME = "[a-z][a-z0-9_]*"
_TRUTH = "depth|semantic_segmentation|instance_segmentation"

PUBLISHED_NAMES: Mapping[str, tuple[tuple[re.Pattern[str], str], ...]] = {
    ADVPIPE: (),
    CARLA_ROS_BRIDGE: (
        (re.compile(f"/({_NAME})/({_NAME})/points"), r"/carla/\1/\2"),
        (re.compile(f"/({_NAME})/ground_truth/({_NAME})/semantic_points"), r"/carla/\1/semantic_\2"),
        (re.compile(f"/({_NAME})/({_NAME})/image/compressed"), r"/carla/\1/\2/image"),
        (re.compile(f"/({_NAME})/({_NAME})/camera_info"), r"/carla/\1/\2/camera_info"),
        (re.compile(f"/({_NAME})/(?:rgb_)?({_NAME})/({_TRUTH})/compressed"), r"/carla/\1/\3_\2/image"),
        (re.compile(f"/({_NAME})/imu"), r"/carla/\1/imu"),
        (re.compile(f"/({_NAME})/gnss/fix"), r"/carla/\1/gnss"),
        (re.compile(f"/({_NAME})/ground_truth/odometry"), r"/carla/\1/odometry"),
    ),
}
"""Patterns of whole names, and what replaces them, by the value of `recording.names`.

Of CARLA's ROS bridge, these topics have the same types as ours, or are converted while they are published
(see `bridge_messages`); its odometry is the truth. Its objects, collisions and vehicle status have types of
its own, and are not among them.
"""


def published_name(topic: str, names: str) -> str:
    """The name under which a topic is published.

    >>> published_name("/ego/lidar/points", "carla_ros_bridge")
    '/carla/ego/lidar'
    """
    for pattern, replacement in PUBLISHED_NAMES[names]:
        if pattern.fullmatch(topic):
            return pattern.sub(replacement, topic)
    return topic
