"""The view of a vehicle's LiDARs, with ground truth, as messages."""

from __future__ import annotations

from advpipe.pipeline.mcap.channel import StampedCdr
from advpipe.pipeline.messages.cloud import cloud_to_cdr, points_to_cdr
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics
from advpipe.pipeline.messages.truth_cdr import detections_cdr, markers_cdr, road_users_cdr
from advpipe.pipeline.sensors.lidar.rig import LidarView


def view_messages(vehicle: str, stamp_ns: int, view: LidarView, with_markers: bool) -> list[StampedCdr]:
    """The clouds, what their rays hit, boxes, road users and, optionally, markers; all with one stamp."""
    messages = []
    for name, cloud in view.clouds.items():
        topic = VehicleTopics(vehicle, name)
        messages.append((topic.lidar_points, cloud_to_cdr(cloud, stamp_ns, topic.lidar_frame), stamp_ns))
    for name, points in view.semantic.items():
        topic = VehicleTopics(vehicle, name)
        messages.append((topic.semantic_points, points_to_cdr(points, stamp_ns, topic.lidar_frame), stamp_ns))
    topic, boxes = VehicleTopics(vehicle), view.boxes
    truth = [
        (topic.objects, detections_cdr(stamp_ns, MAP_FRAME, boxes)),
        (topic.road_users, road_users_cdr(stamp_ns, MAP_FRAME, boxes, view.lidar_points, view.occlusion)),
    ]
    if with_markers:
        truth.append((topic.markers, markers_cdr(stamp_ns, MAP_FRAME, boxes)))
    return messages + [(each, cdr, stamp_ns) for each, cdr in truth]
