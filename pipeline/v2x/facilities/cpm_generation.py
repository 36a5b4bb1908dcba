"""When a station sends a CPM, and which of the objects that it perceives are in it (TS 103 324, 6.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from advpipe.pipeline.v2x.codec.codes import SensorType
from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms
from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.pipeline.v2x.facilities.cam import confidence_ellipse
from advpipe.pipeline.v2x.facilities.cpm import MAX_OBJECTS, Cpm, PerceivedObject, SensorInformation
from advpipe.pipeline.v2x.facilities.cpm_tree import encode_cpm
from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m
from advpipe.pipeline.v2x.facilities.station_state import StationState

OWN_SENSOR_ID = 1
VULNERABLE = ("pedestrian", "cyclist")
"""Classes whose objects the standard treats alike (type A): they are all included, or none."""
MOVING_MPS = 0.5
"""The direction of a slower motion is noise."""


@dataclass(frozen=True, slots=True)
class GeneratedCpm:
    """A CPM and the moment of its generation; `payload` is its UPER encoding."""

    time_ns: int
    payload: bytes
    cpm: Cpm


class _Included(NamedTuple):
    """What the last CPM with an object said of it; the place is from the first reference position."""

    time_ns: int
    east_m: float
    north_m: float
    east_mps: float
    north_mps: float


class CpmGenerator:
    """The collective perception service of one station. Call `check` every `CHECK_INTERVAL_NS`."""

    def __init__(self, rules: CpmRules, sensor: SensorType = SensorType.LIDAR) -> None:
        self._rules, self._sensor = rules, sensor
        self._last_ns: int | None = None
        self._last_sensors_ns: int | None = None
        self._included: dict[int, _Included] = {}
        self._anchor_deg: tuple[float, float] | None = None

    def check(
        self,
        time_ns: int,
        state: StationState,
        objects: Sequence[PerceivedObject],
        dcc_interval_s: float = 0.0,
    ) -> GeneratedCpm | None:
        """The CPM that the station sends at this time, or None.

        state: the newest one, whose time is the reference time and whose position is the reference position.
        objects: all that it perceives. dcc_interval_s: the minimum time between two messages that congestion
        control allows now. Raises CpmError for a state that a CPM cannot represent.
        """
        interval_s = min(max(self._rules.min_interval_s, dcc_interval_s), self._rules.max_interval_s)
        if self._last_ns is not None and time_ns - self._last_ns < round(interval_s * 1e9):
            return None
        now = {one.object_id: self._included_as(time_ns, state, one) for one in objects}
        self._included = {key: at for key, at in self._included.items() if key in now}
        chosen = self._chosen(objects, now)
        has_sensors = self._is_sensor_information_due(time_ns)
        if not chosen and not has_sensors:
            return None
        chosen = sorted(chosen, key=lambda one: (math.hypot(one.east_m, one.north_m), one.object_id))
        chosen = chosen[: self._rules.max_objects]
        self._included.update((one.object_id, now[one.object_id]) for one in chosen)
        self._last_ns = time_ns
        sensors = None
        if has_sensors:
            self._last_sensors_ns = time_ns
            sensors = (SensorInformation(OWN_SENSOR_ID, self._sensor, self._rules.range_m),)
        cpm = _message(state, chosen, len(objects), sensors)
        return GeneratedCpm(time_ns, encode_cpm(cpm), cpm)

    def _chosen(self, objects: Sequence[PerceivedObject], now: dict[int, _Included]) -> list[PerceivedObject]:
        vulnerable = [one for one in objects if one.label in VULNERABLE]
        others = [one for one in objects if one.label not in VULNERABLE]
        is_any_due = any(self._is_vulnerable_due(now[one.object_id], one.object_id) for one in vulnerable)
        chosen = vulnerable if is_any_due else []
        return [*chosen, *(one for one in others if self._is_due(now[one.object_id], one.object_id))]

    def _is_vulnerable_due(self, now: _Included, object_id: int) -> bool:
        last = self._included.get(object_id)
        return last is None or now.time_ns - last.time_ns >= round(self._rules.max_interval_s * 1e9 / 2)

    def _is_due(self, now: _Included, object_id: int) -> bool:
        last, rules = self._included.get(object_id), self._rules
        if last is None or now.time_ns - last.time_ns >= round(rules.max_interval_s * 1e9):
            return True
        if math.hypot(now.east_m - last.east_m, now.north_m - last.north_m) > rules.position_m:
            return True
        speed_mps, last_mps = (math.hypot(each.east_mps, each.north_mps) for each in (now, last))
        if abs(speed_mps - last_mps) > rules.speed_mps:
            return True
        turn_rad = math.atan2(now.north_mps, now.east_mps) - math.atan2(last.north_mps, last.east_mps)
        is_moving = min(speed_mps, last_mps) > MOVING_MPS
        return is_moving and abs(math.remainder(turn_rad, math.tau)) > math.radians(rules.heading_deg)

    def _included_as(self, time_ns: int, state: StationState, one: PerceivedObject) -> _Included:
        place_deg = state.latitude_deg, state.longitude_deg
        self._anchor_deg = self._anchor_deg or place_deg
        east_m, north_m = east_north_m(*self._anchor_deg, *place_deg)
        return _Included(time_ns, east_m + one.east_m, north_m + one.north_m, one.east_mps, one.north_mps)

    def _is_sensor_information_due(self, time_ns: int) -> bool:
        last_ns = self._last_sensors_ns
        return last_ns is None or time_ns - last_ns >= round(self._rules.sensor_interval_s * 1e9)


def _message(
    state: StationState,
    objects: Sequence[PerceivedObject],
    perceived: int,
    sensors: tuple[SensorInformation, ...] | None,
) -> Cpm:
    semi_major_m, semi_minor_m, semi_major_rad = confidence_ellipse(state.east_north_covariance_m2)
    return Cpm(
        station_id=state.station_id,
        reference_ms=timestamp_its_ms(state.time_ns),
        latitude_deg=state.latitude_deg,
        longitude_deg=state.longitude_deg,
        altitude_m=state.altitude_m,
        semi_major_m=semi_major_m,
        semi_minor_m=semi_minor_m,
        semi_major_rad=semi_major_rad,
        heading_rad=state.heading_rad,
        heading_std_rad=state.heading_std_rad,
        perceived=min(perceived, MAX_OBJECTS),
        objects=tuple(objects),
        sensors=sensors,
    )
