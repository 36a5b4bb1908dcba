"""A collective perception message (CPM, ETSI TS 103 324) in SI units, as a receiver of it needs it."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.v2x.codec.codes import SensorType

MAX_OBJECTS = 255
MAX_SENSORS = 128


@dataclass(frozen=True, kw_only=True, slots=True)
class PerceivedObject:
    """An object that a station perceives, where it was when it was measured.

    object_id: the station's own, 0 to 65,535. measured_ms: from the message's reference time, negative in
    its past. east_m, north_m, up_m: of the centre of its box from the message's reference position.
    yaw_rad: of its length, counter-clockwise from east. label: a class of the ground truth, or "unknown".
    quality: confidence that it exists, 0 to 15. age_ms: since the station first perceived it, at most 2,047.
    Standard deviations (`_std_`) are 1 sigma. None: not stated.
    """

    object_id: int
    measured_ms: int
    east_m: float
    north_m: float
    east_mps: float
    north_mps: float
    label: str = "unknown"
    up_m: float | None = None
    yaw_rad: float | None = None
    length_m: float | None = None
    width_m: float | None = None
    height_m: float | None = None
    position_std_m: float | None = None
    speed_std_mps: float | None = None
    yaw_std_rad: float | None = None
    age_ms: int = 0
    quality: int = 15
    sensor_ids: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class SensorInformation:
    """A sensor of the station, and the circle around its reference position in which it perceives objects
    that are not hidden. range_m: None if it is not stated."""

    sensor_id: int
    type: SensorType
    range_m: float | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Cpm:
    """One message. reference_ms: TimestampIts, see `timestamps.py`.

    The reference position is that of the station's CAMs: the ground below the middle of the vehicle's front
    side. heading_rad: clockwise from true north. perceived: the number of objects that the station
    perceives, of which the message may hold fewer, 255 at most. sensors: None without the container.
    """

    station_id: int
    reference_ms: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None = None
    semi_major_m: float | None = None
    semi_minor_m: float | None = None
    semi_major_rad: float | None = None
    heading_rad: float | None = None
    heading_std_rad: float | None = None
    perceived: int = 0
    objects: tuple[PerceivedObject, ...] = ()
    sensors: tuple[SensorInformation, ...] | None = None
