"""advpipe_msgs/HeardObjectArray: the objects of a Local Dynamic Map that other stations report."""

from __future__ import annotations

from typing import Any

from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cdr import Cdr
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot


def heard_objects_cdr(snapshot: LdmSnapshot, frame_id: str = "map") -> bytes:
    """The objects heard of in a map, serialised."""
    cdr = Cdr()
    cdr.header(snapshot.time_ns, frame_id)
    cdr.uint32(len(snapshot.heard))
    for one in snapshot.heard:
        cdr.uint32(one.station_id)
        cdr.uint16(one.object_id)
        cdr.string(one.label)
        cdr.time(one.measured_ns)
        cdr.time(one.received_ns)
        cdr.float64(*one.centre_m)
        cdr.float32(one.yaw_rad, *one.velocity_mps, one.length_m, one.width_m, one.height_m)
    return bytes(cdr)


def heard_objects_of_message(message: Any) -> tuple[HeardObject, ...]:
    """The objects of a recorded message."""
    return tuple(
        HeardObject(
            station_id=int(one.station_id),
            object_id=int(one.object_id),
            label=one.class_id,
            measured_ns=_time_ns(one.measurement_time),
            received_ns=_time_ns(one.reception_time),
            centre_m=(one.centre.x, one.centre.y, one.centre.z),
            yaw_rad=float(one.yaw),
            velocity_mps=(float(one.velocity_x), float(one.velocity_y)),
            length_m=float(one.length),
            width_m=float(one.width),
            height_m=float(one.height),
        )
        for one in message.objects
    )


def _time_ns(stamp: Any) -> int:
    return int(stamp.sec) * build.NS_PER_S + int(stamp.nanosec)
