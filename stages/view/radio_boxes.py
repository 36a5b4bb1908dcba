"""What a vehicle received by radio, as boxes on the ground: CAMs, and entries of its Local Dynamic Map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from advpipe.pipeline.bag.latched import ReceiversInfo, read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.ldm import class_of
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.v2x.codec.btp import cam_payload
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.pipeline.v2x.facilities.ldm import LdmReport, report_of_cam
from advpipe.pipeline.viewer.scene import ALWAYS, ATTACKED, CAM, CHANGED, CLEAN, LDM, Fact, SceneBox

LATELY_NS = 1_000_000_000
"""CAMs are shown for as long after they were received: stations send one at least that often."""

LDM_HEIGHT_M = 1.0
"""No CAM states a height: one is drawn flat, and an entry of the map so high, to tell them apart."""

_UNSTATED_M = 0.8
"""Side of the box of a station that states no size."""

NOT_STATED = "not stated"


def radio_boxes(
    reader: BagReader, topics: VehicleTopics, time_ns: int, lidar_SE3_map: Float64, origin: Geodesy | None
) -> list[SceneBox]:
    """The entries of the vehicle's Local Dynamic Map and the CAMs that it received within the last second, in
    the LiDAR's frame. origin: of the map; without it, CAMs are left out."""
    snapshot: Any = None
    received: dict[int, SceneBox] = {}  # the last one of each station
    wanted = (topics.ldm, topics.received_raw)
    names = [one.name for one in wanted if one.name in reader.topics_of_type(one.type)]
    for raw in reader.raw_messages(names, max(0, time_ns - LATELY_NS), time_ns):
        message = reader.decode(raw)
        if raw.topic.name == topics.ldm.name:
            snapshot = message
        elif origin and (report := _report(message, raw.log_time_ns, origin)):
            age_s = (time_ns - raw.log_time_ns) * 1e-9
            received[report.station_id] = _cam_box(report, age_s, lidar_SE3_map)
    entries = snapshot.objects if snapshot else ()
    return [*(_ldm_box(entry, lidar_SE3_map) for entry in entries), *received.values()]


def origin_of(reader: BagReader) -> Geodesy | None:
    """Where on Earth the map lies; None for a bag without it."""
    if SCENARIO_INFO.name not in reader.topics:
        return None
    try:
        at = read_scenario_info(reader, ReceiversInfo).map.origin
    except AdvpipeError:
        return None
    return Geodesy(at.latitude_deg, at.longitude_deg, at.altitude_m)


def on_both(clean: Sequence[SceneBox], attacked: Sequence[SceneBox]) -> Iterator[SceneBox]:
    """The boxes of a clean and of an adversarial bag together: what is equal in both is shown on both."""
    known = {_claim(box): box for box in clean}
    again = {_claim(box) for box in attacked}
    for box in attacked:
        if _claim(box) in known:
            yield box
        else:
            yield replace(box, outcome=CHANGED, condition=ATTACKED)
    for claim, box in known.items():
        if claim not in again:
            yield replace(box, condition=CLEAN)


def _claim(box: SceneBox) -> tuple[object, ...]:
    return box.role, box.id, *(round(value, 2) for value in box.box)


def _report(message: Any, received_ns: int, origin: Geodesy) -> LdmReport | None:
    try:
        return report_of_cam(decode_cam(cam_payload(bytes(message.data))), received_ns, origin)
    except CamError:
        return None


def _cam_box(report: LdmReport, age_s: float, lidar_SE3_map: Float64) -> SceneBox:
    return SceneBox(
        CAM,
        _in_lidar_frame(report.centre_m, report, lidar_SE3_map),
        f"CAM of station {report.station_id}",
        condition=ALWAYS,
        id=f"cam {report.station_id}",
        group="CAMs",
        facts=(
            Fact("station type", class_of(report.station_type)),
            Fact("received", f"{age_s:.2f} s before"),
            *_motion(report.speed_mps, report.yaw_rad),
        ),
    )


def _ldm_box(entry: Any, lidar_SE3_map: Float64) -> SceneBox:
    size = _Sized(entry.length, entry.width, entry.yaw)
    centre = (entry.centre.x, entry.centre.y, entry.centre.z)
    return SceneBox(
        LDM,
        _in_lidar_frame(centre, size, lidar_SE3_map, LDM_HEIGHT_M),
        f"{entry.class_id}, station {entry.station_id}",
        id=f"ldm {entry.station_id}",
        group="Local Dynamic Map",
        facts=(Fact("age of the entry", f"{entry.age:.2f} s"), *_motion(entry.speed, entry.yaw)),
    )


class _Sized:
    def __init__(self, length_m: float, width_m: float, yaw_rad: float) -> None:
        self.length_m, self.width_m, self.yaw_rad = length_m, width_m, yaw_rad


def _motion(speed_mps: float, yaw_rad: float) -> tuple[Fact, Fact]:
    speed = f"{speed_mps:.1f} m/s" if math.isfinite(speed_mps) else NOT_STATED
    heading = f"{math.degrees(yaw_rad) % 360:.0f}° from +x" if math.isfinite(yaw_rad) else NOT_STATED
    return Fact("speed", speed), Fact("heading on the map", heading)


def _in_lidar_frame(
    centre_m: tuple[float, float, float],
    body: LdmReport | _Sized,
    lidar_SE3_map: Float64,
    height_m: float = 0.0,
) -> list[float]:
    sizes_m = [_known(body.length_m, _UNSTATED_M), _known(body.width_m, _UNSTATED_M), height_m]
    x_m, y_m, z_m = centre_m
    box = np.array([[x_m, y_m, z_m + height_m / 2, *sizes_m, _known(body.yaw_rad, 0.0)]])
    boxes = Boxes(box, np.zeros(1, np.int64), ("",), np.zeros((1, 3)))
    return [float(value) for value in boxes.transformed(lidar_SE3_map).geometry[0]]


def _known(value: float, otherwise: float) -> float:
    return value if math.isfinite(value) and value != 0 else otherwise
