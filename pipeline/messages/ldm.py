"""Messages of a Local Dynamic Map (LDM): advpipe's own type, and the same objects in a standard type."""

from __future__ import annotations

import math

from advpipe.pipeline.messages.cdr import Cdr
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.pipeline.v2x.facilities.ldm import Entry, LdmReport, LdmSnapshot

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
"""The ground truth's class of each station type; other station types have the class "unknown"."""
_CLASS_OF_NUMBER = {int(station_type): name for station_type, name in CLASS_OF_STATION_TYPE.items()}
_NO_COVARIANCE = bytes(36 * 8)


def class_of(station_type: int) -> str:
    """The class name of an ETSI stationType; "unknown" for any number without a class."""
    return _CLASS_OF_NUMBER.get(station_type, UNKNOWN_CLASS)


def ldm_snapshot_cdr(snapshot: LdmSnapshot, frame_id: str = "map") -> bytes:
    """advpipe_msgs/LdmSnapshot, serialised."""
    cdr = Cdr()
    cdr.header(snapshot.time_ns, frame_id)
    cdr.uint32(len(snapshot.entries))
    for entry in snapshot.entries:
        _add_object(cdr, entry, snapshot.age_s(entry))
    cdr.uint32(*snapshot.verdicts.values())
    return bytes(cdr)


def ldm_detections_cdr(snapshot: LdmSnapshot, frame_id: str = "map") -> bytes:
    """vision_msgs/Detection3DArray, serialised.

    Ids are station ids, scores are 1, and sizes are 0 where a CAM does not state them. CAMs never state a
    height, so boxes have height 0 and lie on the ground.
    """
    cdr = Cdr()
    cdr.header(snapshot.time_ns, frame_id)
    cdr.uint32(len(snapshot.entries))
    for entry in snapshot.entries:
        cdr.header(snapshot.time_ns, frame_id)
        _add_detection(cdr, entry.report)
    return bytes(cdr)


def _add_object(cdr: Cdr, entry: Entry, age_s: float) -> None:
    report = entry.report
    cdr.uint32(report.station_id)
    cdr.uint8(report.station_type)
    cdr.string(class_of(report.station_type))
    cdr.time(report.generation_ns)
    cdr.time(entry.received_ns)
    cdr.float32(age_s)
    cdr.float64(*report.front_m, *report.centre_m)
    cdr.float32(report.yaw_rad, report.speed_mps, report.length_m, report.width_m)


def _add_detection(cdr: Cdr, report: LdmReport) -> None:
    """vision_msgs/Detection3D without its header: one hypothesis, the box, the id."""
    half_yaw = _finite_or_zero(report.yaw_rad) / 2
    pose = (*report.centre_m, 0.0, 0.0, math.sin(half_yaw), math.cos(half_yaw))
    cdr.uint32(1)
    cdr.string(class_of(report.station_type))
    cdr.float64(1.0, *pose)
    cdr.body += _NO_COVARIANCE
    cdr.float64(*pose, _finite_or_zero(report.length_m), _finite_or_zero(report.width_m), 0.0)
    cdr.string(str(report.station_id))


def _finite_or_zero(value: float) -> float:
    return value if math.isfinite(value) else 0.0
