"""What a received message claims, in the units and the frame that the checks work in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.misbehaviour.roads import NO_ROADS, RoadMap
from advpipe.pipeline.v2x.codec.codes import DriveDirection
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.ldm import LdmReport, reports_of_cams

_REQUIRED_FIELDS = (
    *("latitude_deg", "longitude_deg", "heading_rad", "speed_mps", "length_m", "width_m"),
    *("longitudinal_acceleration_mps2", "yaw_rate_radps"),
)
"""Fields of a vehicle's CAM that the checks depend on and that honest vehicles always fill in."""


class Claim(NamedTuple):
    """The claims of one received message: NaN where it does not state a value.

    arrival_ns, generation_ns: UTC since 1970. x_m, y_m: the centre of its box on the map, or the middle of
    the front side where it states no direction or length. yaw_rad: from +x to +y. speed_mps: along the yaw,
    negative backwards. position_m, speed_confidence_mps,
    heading_confidence_rad: claimed half-widths at 95 %. invalid: number of required fields that are out of
    range or missing; a message that is not a CAM has only this, and station id -1.
    off_road_m, wrong_way_rad: see `RoadMap.measure`. may_be_known: a new station id that may be the next
    pseudonym of a station that was heard before (`PseudonymLinks`).
    """

    station_id: int
    arrival_ns: int
    generation_ns: int
    x_m: float = math.nan
    y_m: float = math.nan
    yaw_rad: float = math.nan
    speed_mps: float = math.nan
    acceleration_mps2: float = math.nan
    yaw_rate_radps: float = math.nan
    length_m: float = math.nan
    width_m: float = math.nan
    position_m: float = 0.0
    speed_confidence_mps: float = 0.0
    heading_confidence_rad: float = 0.0
    station_type: int = 0
    invalid: int = 0
    off_road_m: float = math.nan
    wrong_way_rad: float = math.nan
    may_be_known: bool = False

    @property
    def is_cam(self) -> bool:
        """Whether the claim is from a CAM: it has a station id."""
        return self.station_id >= 0


class ReceivingVehicle(NamedTuple):
    """The receiving vehicle's own estimate when a message arrives: the centre of its box."""

    station_id: int
    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    position_m: float = 0.0


def claims_of_cams(
    cams: Sequence[Cam | None], arrivals_ns: Sequence[int], geodesy: Geodesy, roads: RoadMap = NO_ROADS
) -> list[Claim]:
    """The claims of received CAMs, vectorised: projecting many costs little more time than one.

    None stands for a message that is not a CAM.
    """
    known = [index for index, cam in enumerate(cams) if cam is not None]
    chosen = [cam for cam in cams if cam is not None]
    reports = reports_of_cams(chosen, [arrivals_ns[index] for index in known], geodesy)
    claims = [Claim(-1, arrival_ns, arrival_ns) for arrival_ns in arrivals_ns]
    for index, cam, report in zip(known, chosen, reports, strict=True):
        claims[index] = _claim(cam, report, arrivals_ns[index])
    places = [(claim.x_m, claim.y_m, claim.yaw_rad) for claim in claims]
    off_road_m, wrong_way_rad = roads.measure(places)
    return [
        claim._replace(off_road_m=off, wrong_way_rad=wrong)
        for claim, off, wrong in zip(claims, off_road_m.tolist(), wrong_way_rad.tolist(), strict=True)
    ]


def _claim(cam: Cam, report: LdmReport | None, arrival_ns: int) -> Claim:
    invalid = 0
    if cam.roadside is None:
        values = [getattr(cam, name) for name in _REQUIRED_FIELDS]
        invalid = sum(value is None or not math.isfinite(value) for value in values)
    if report is None:
        return Claim(cam.station_id, arrival_ns, arrival_ns, invalid=max(invalid, 1))
    sign = -1.0 if cam.drive_direction is DriveDirection.BACKWARD else 1.0
    return Claim(
        cam.station_id,
        arrival_ns,
        report.generation_ns,
        report.centre_m[0],
        report.centre_m[1],
        report.yaw_rad,
        sign * report.speed_mps,
        _number(cam.longitudinal_acceleration_mps2),
        _number(cam.yaw_rate_radps),
        report.length_m,
        report.width_m,
        _confidence(cam.semi_major_m),
        _confidence(cam.speed_confidence_mps),
        _confidence(cam.heading_confidence_rad),
        cam.station_type,
        invalid,
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _confidence(value: float | None) -> float:
    return value if value is not None and math.isfinite(value) else 0.0
