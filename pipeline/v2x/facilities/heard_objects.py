"""The objects in a Local Dynamic Map that the vehicle has heard of in CPMs, and not perceived itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.codec.timestamps import unix_ns
from advpipe.pipeline.v2x.facilities.cpm import Cpm, PerceivedObject
from advpipe.pipeline.v2x.facilities.verdict import Verdict

_NORTHWARD_DEG = 1e-4


@dataclass(frozen=True, slots=True)
class HeardObject:
    """An object as one station reports it, in the map's frame.

    station_id: who reports it. object_id: its id there. measured_ns: UTC since 1970. centre_m: of its box.
    yaw_rad: from +x to +y. velocity_mps: x and y. NaN where the CPM states no value.
    """

    station_id: int
    object_id: int
    label: str
    measured_ns: int
    received_ns: int
    centre_m: tuple[float, float, float]
    yaw_rad: float
    velocity_mps: tuple[float, float]
    length_m: float
    width_m: float
    height_m: float

    def moved_m(self, now_ns: int) -> tuple[float, float]:
        """x and y of its centre now, if it moved on with its velocity; as measured without one."""
        elapsed_s = (now_ns - self.measured_ns) / 1e9
        x_mps, y_mps = self.velocity_mps
        if not math.isfinite(x_mps + y_mps):
            return self.centre_m[0], self.centre_m[1]
        return self.centre_m[0] + x_mps * elapsed_s, self.centre_m[1] + y_mps * elapsed_s


class MapFrame(NamedTuple):
    """Where a CPM's reference position is on the map, and how its axes lie there.

    at_m: x, y, z. turn_rad: from the map's x axis to the east.
    """

    at_m: tuple[float, float, float]
    turn_rad: float

    def turned(self, east: float, north: float) -> tuple[float, float]:
        """East and north along the map's x and y."""
        cosine, sine = math.cos(self.turn_rad), math.sin(self.turn_rad)
        return cosine * east - sine * north, sine * east + cosine * north

    def to_map(self, east_m: float, north_m: float) -> tuple[float, float]:
        """x and y of a place east and north of the reference position."""
        x_m, y_m = self.turned(east_m, north_m)
        return self.at_m[0] + x_m, self.at_m[1] + y_m

    def to_east_north(self, x_m: float, y_m: float) -> tuple[float, float]:
        """The inverse of `to_map`."""
        cosine, sine = math.cos(self.turn_rad), math.sin(self.turn_rad)
        x_m, y_m = x_m - self.at_m[0], y_m - self.at_m[1]
        return cosine * x_m + sine * y_m, cosine * y_m - sine * x_m


def map_frame(cpm: Cpm, geodesy: Geodesy) -> MapFrame | None:
    """The frame of a CPM's reference position; None on the other side of the Earth.

    Without an altitude, it is on the map's zero level.
    """
    altitude_m = cpm.altitude_m
    if altitude_m is None or not math.isfinite(altitude_m):
        altitude_m = float(geodesy.to_geographic([0.0, 0.0, 0.0])[2])
    if abs(cpm.latitude_deg) >= 90 or abs(cpm.longitude_deg) > 180:
        return None
    x_m, y_m, z_m = geodesy.to_map((cpm.latitude_deg, cpm.longitude_deg, altitude_m)).tolist()
    north_x_m, north_y_m = geodesy.place_m(cpm.latitude_deg + _NORTHWARD_DEG, cpm.longitude_deg)
    if not math.isfinite(x_m + y_m + north_x_m + north_y_m):
        return None
    turn_rad = math.atan2(north_y_m - y_m, north_x_m - x_m) - math.pi / 2
    return MapFrame((x_m, y_m, z_m), turn_rad)


def heard_objects(cpm: Cpm, geodesy: Geodesy, received_ns: int = 0) -> list[HeardObject] | None:
    """The objects of a CPM; None for a reference position on the other side of the Earth.

    An object without a height above the reference position stands there.
    """
    frame = map_frame(cpm, geodesy)
    if frame is None:
        return None
    reference_ns = unix_ns(cpm.reference_ms)
    return [_heard(cpm.station_id, frame, reference_ns, received_ns, one) for one in cpm.objects]


def _heard(
    station_id: int, frame: MapFrame, reference_ns: int, received_ns: int, one: PerceivedObject
) -> HeardObject:
    height_m = _number(one.height_m)
    up_m = one.up_m if one.up_m is not None else (height_m / 2 if math.isfinite(height_m) else 0.0)
    yaw_rad = _number(one.yaw_rad) + frame.turn_rad
    return HeardObject(
        station_id=station_id,
        object_id=one.object_id,
        label=one.label,
        measured_ns=reference_ns + one.measured_ms * 1_000_000,
        received_ns=received_ns,
        centre_m=(*frame.to_map(one.east_m, one.north_m), frame.at_m[2] + up_m),
        yaw_rad=math.remainder(yaw_rad, math.tau) if math.isfinite(yaw_rad) else math.nan,
        velocity_mps=frame.turned(one.east_mps, one.north_mps),
        length_m=_number(one.length_m),
        width_m=_number(one.width_m),
        height_m=height_m,
    )


class HeardObjects:
    """For each station and object id, the object as it was measured last, until it is too old.

    Stations are trusted; one object that several stations report is several entries.
    """

    def __init__(self, kept_s: float) -> None:
        self._kept_ns = round(kept_s * 1e9)
        self._known: dict[tuple[int, int], HeardObject] = {}

    def receive(self, objects: Sequence[HeardObject] | None, received_ns: int) -> Verdict:
        """Process the objects of a received CPM; None stands for one without a position on the map.

        A CPM without objects is accepted.
        """
        if objects is None:
            return Verdict.UNPLACED
        verdicts = [self._judge(one, received_ns) for one in objects]
        for one, verdict in zip(objects, verdicts, strict=True):
            if verdict is Verdict.ACCEPTED:
                self._known[one.station_id, one.object_id] = replace(one, received_ns=received_ns)
        return verdicts[0] if verdicts and Verdict.ACCEPTED not in verdicts else Verdict.ACCEPTED

    def snapshot(self, now_ns: int) -> tuple[HeardObject, ...]:
        """Remove the old ones, and return the others, by station and object."""
        self._known = {
            key: one for key, one in sorted(self._known.items()) if one.measured_ns + self._kept_ns >= now_ns
        }
        return tuple(self._known.values())

    def _judge(self, one: HeardObject, now_ns: int) -> Verdict:
        if one.measured_ns + self._kept_ns < now_ns:
            return Verdict.EXPIRED
        if one.measured_ns > now_ns + self._kept_ns:
            return Verdict.FUTURE
        known = self._known.get((one.station_id, one.object_id))
        return Verdict.SUPERSEDED if known and known.measured_ns > one.measured_ns else Verdict.ACCEPTED


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
