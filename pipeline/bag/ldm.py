"""Messages of a Local Dynamic Map: advpipe's own, and a mirror of a type that every ROS 2 knows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from advpipe.pipeline.bag import messages
from advpipe.pipeline.bag.types import message_class
from advpipe.pipeline.v2x.codes import StationType
from advpipe.pipeline.v2x.ldm import Report, Snapshot

UNKNOWN_CLASS = "unknown"

CLASS_OF_STATION_TYPE = {
    StationType.PEDESTRIAN: "pedestrian",
    StationType.CYCLIST: "cyclist",
    StationType.MOPED: "cyclist",
    StationType.MOTORCYCLE: "cyclist",
    StationType.PASSENGER_CAR: "car",
    StationType.BUS: "truck",
    StationType.LIGHT_TRUCK: "truck",
    StationType.HEAVY_TRUCK: "truck",
    StationType.TRAILER: "truck",
}
"""Classes as in the ground truth; other station types are unknown."""


def class_of(station_type: int) -> str:
    """The class of ETSI's stationType, any number."""
    known = {int(kind): name for kind, name in CLASS_OF_STATION_TYPE.items()}
    return known.get(station_type, UNKNOWN_CLASS)


def ldm_snapshot(snapshot: Snapshot, frame_id: str = "map") -> Any:
    """advpipe_msgs/LdmSnapshot."""
    Object = message_class("advpipe_msgs/msg/LdmObject")
    return message_class("advpipe_msgs/msg/LdmSnapshot")(
        header=messages.header(snapshot.time_ns, frame_id),
        objects=[
            Object(
                station_id=entry.report.station_id,
                station_type=entry.report.station_type,
                class_id=class_of(entry.report.station_type),
                generation_time=messages.time(entry.report.generation_ns),
                reception_time=messages.time(entry.received_ns),
                age=snapshot.age_s(entry),
                reference_point=messages.point(entry.report.front_m),
                centre=messages.point(entry.report.centre_m),
                yaw=entry.report.yaw_rad,
                speed=entry.report.speed_mps,
                length=entry.report.length_m,
                width=entry.report.width_m,
            )
            for entry in snapshot.entries
        ],
        **{verdict.name.lower(): count for verdict, count in snapshot.verdicts.items()},
    )


def ldm_detections(snapshot: Snapshot, frame_id: str = "map") -> Any:
    """vision_msgs/Detection3DArray: ids are station ids, scores 1, sizes 0 where a CAM does not tell them.

    No CAM tells a height: boxes are flat and lie on the ground.
    """
    Detection = message_class("vision_msgs/msg/Detection3D")
    Result = message_class("vision_msgs/msg/ObjectHypothesisWithPose")
    Hypothesis = message_class("vision_msgs/msg/ObjectHypothesis")
    Bounds = message_class("vision_msgs/msg/BoundingBox3D")
    PoseWithCovariance = message_class("geometry_msgs/msg/PoseWithCovariance")
    header = messages.header(snapshot.time_ns, frame_id)
    items = []
    for entry in snapshot.entries:
        report = entry.report
        size_m, pose = _size_m(report), messages.box_pose([*report.centre_m, 0, 0, 0, _known(report.yaw_rad)])
        result = Result(
            hypothesis=Hypothesis(class_id=class_of(report.station_type), score=1.0),
            pose=PoseWithCovariance(pose=pose, covariance=np.zeros(36)),
        )
        bounds = Bounds(center=pose, size=messages.vector3(size_m))
        items.append(Detection(header=header, results=[result], bbox=bounds, id=str(report.station_id)))
    return message_class("vision_msgs/msg/Detection3DArray")(header=header, detections=items)


def _size_m(report: Report) -> tuple[float, float, float]:
    return _known(report.length_m), _known(report.width_m), 0.0


def _known(value: float) -> float:
    return value if math.isfinite(value) else 0.0
