"""The messages of an imported drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.core.text import escape_unprintable
from advpipe.pipeline.geometry.boxes import Boxes, count_points
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.mcap.channel import StampedCdr, Topic
from advpipe.pipeline.messages import build, topics
from advpipe.pipeline.messages.cloud import cloud_to_cdr, xyz
from advpipe.pipeline.messages.labels import coverage_message, ignored_message, image_labels_message
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics
from advpipe.pipeline.messages.types import message_class, serialise
from advpipe.stages.import_.drive import CameraView, DriveFrame, VehicleFrame


def static_messages(
    stamp_ns: int, static_transforms: Sequence[tuple[str, str, Float64]]
) -> Iterator[StampedCdr]:
    """What is recorded once, at the stamp of the first frame."""
    if static_transforms:
        yield _stamped(topics.TF_STATIC, build.transforms(stamp_ns, static_transforms), stamp_ns)


def frame_messages(frame: DriveFrame) -> Iterator[StampedCdr]:
    """The messages of one instant, all with its stamp."""
    stamp_ns = frame.stamp_ns
    yield _stamped(topics.CLOCK, build.clock(stamp_ns), stamp_ns)
    moving = [transform for name, vehicle in frame.vehicles.items() for transform in _moving(name, vehicle)]
    if moving:
        yield _stamped(topics.TF, build.transforms(stamp_ns, moving), stamp_ns)
    if frame.source_name:
        name = message_class(topics.SOURCE_FRAME.type)(data=escape_unprintable(frame.source_name))
        yield _stamped(topics.SOURCE_FRAME, name, stamp_ns)
    for name, vehicle in frame.vehicles.items():
        yield from _vehicle_messages(name, vehicle, stamp_ns)


def _moving(name: str, vehicle: VehicleFrame) -> Iterator[tuple[str, str, Float64]]:
    if vehicle.map_SE3_base is not None:
        yield MAP_FRAME, VehicleTopics(name).base_frame, vehicle.map_SE3_base
    yield from vehicle.transforms


def _vehicle_messages(name: str, vehicle: VehicleFrame, stamp_ns: int) -> Iterator[StampedCdr]:
    own, frame_id = VehicleTopics(name), vehicle.boxes_frame
    if vehicle.boxes is not None:
        yield _stamped(own.objects, build.detections_message(stamp_ns, frame_id, vehicle.boxes), stamp_ns)
        if vehicle.lidar_points is not None or np.isfinite(vehicle.boxes.velocity_mps).any():
            yield _stamped(own.road_users, _road_users(vehicle, vehicle.boxes, stamp_ns), stamp_ns)
        yield _stamped(own.ignored_objects, ignored_message(stamp_ns, frame_id, vehicle.ignored), stamp_ns)
        if vehicle.coverage.labelled or vehicle.coverage.ignored:
            coverage = coverage_message(stamp_ns, frame_id, vehicle.coverage)
            yield _stamped(own.label_coverage, coverage, stamp_ns)
    for camera, view in vehicle.cameras.items():
        yield _stamped(own.camera_info(camera), _camera_info(own, camera, view, stamp_ns), stamp_ns)
        if view.labels is not None:
            labels = image_labels_message(stamp_ns, own.sensor_frame(camera), view.labels)
            yield _stamped(own.image_labels(camera), labels, stamp_ns)
    for lidar, cloud in vehicle.clouds.items():
        of_lidar = VehicleTopics(name, lidar)
        yield of_lidar.lidar_points, cloud_to_cdr(cloud, stamp_ns, of_lidar.lidar_frame), stamp_ns


def _road_users(vehicle: VehicleFrame, boxes: Boxes, stamp_ns: int) -> Any:
    """Velocities, and the LiDAR points on each box: the source's count, or ours in a LiDAR's frame, or 0."""
    own_lidar = vehicle.boxes_frame.rpartition("/")[2]
    counts = np.zeros(len(boxes), np.int64)
    if vehicle.lidar_points is not None:
        counts = vehicle.lidar_points
    elif own_lidar in vehicle.clouds:
        counts = count_points(xyz(vehicle.clouds[own_lidar]), boxes.geometry)
    return build.road_users(stamp_ns, vehicle.boxes_frame, boxes, counts, np.full(len(boxes), np.nan))


def _camera_info(own: VehicleTopics, camera: str, view: CameraView, stamp_ns: int) -> Any:
    Info = message_class("sensor_msgs/msg/CameraInfo")
    Region = message_class("sensor_msgs/msg/RegionOfInterest")
    return Info(
        header=build.message_header(stamp_ns, own.sensor_frame(camera)),
        height=view.height_px,
        width=view.width_px,
        distortion_model="plumb_bob",
        d=np.array(view.distortion or (0.0,) * 5, np.float64),
        k=np.asarray(view.matrix_K, np.float64).ravel(),
        r=np.asarray(view.rectification_R, np.float64).ravel(),
        p=np.asarray(view.projection_P, np.float64).ravel(),
        binning_x=0,
        binning_y=0,
        roi=Region(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def _stamped(topic: Topic, message: Any, stamp_ns: int) -> StampedCdr:
    return topic, serialise(message, topic.type), stamp_ns
