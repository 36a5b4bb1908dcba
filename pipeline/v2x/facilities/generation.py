"""When a vehicle sends a CAM, and its contents (EN 302 637-2 v1.4.1, 6.1.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Flag, auto

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.v2x.facilities.cam import MAX_PATH_POINTS, Cam, LowFrequency, cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam
from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m
from advpipe.pipeline.v2x.facilities.path_history import PathHistory
from advpipe.pipeline.v2x.facilities.reference_point import ReferencePoint
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import CamRules

CHECK_INTERVAL_NS = 100_000_000
"""T_CheckCamGen."""
START_NS = 1_000_000_000
"""The interval in which the stations of a drive's first step are switched on."""


@dataclass(frozen=True, kw_only=True)
class GenerationRules:
    """The standard's constants; a change has to exceed its threshold."""

    min_interval_s: float = 0.1
    max_interval_s: float = 1.0
    heading_change_rad: float = math.radians(4)
    position_change_m: float = 4.0
    speed_change_mps: float = 0.5
    low_dynamics_cams: int = 3
    """N_GenCam: after this many consecutive CAMs without dynamics, the interval returns to its maximum; 0: it
    never leaves it."""
    low_frequency_interval_s: float = 0.5
    path_points: int = MAX_PATH_POINTS

    @classmethod
    def of(cls, section: CamRules) -> GenerationRules:
        """The rules that a scenario sets."""
        return cls(
            min_interval_s=section.min_interval_s,
            max_interval_s=section.max_interval_s,
            heading_change_rad=math.radians(section.heading_deg),
            position_change_m=section.position_m,
            speed_change_mps=section.speed_mps,
            low_dynamics_cams=section.low_dynamics_cams,
            low_frequency_interval_s=section.low_frequency_interval_s,
            path_points=section.path_points,
        )


class Cause(Flag):
    """The conditions that triggered a CAM."""

    FIRST = auto()
    HEADING = auto()
    POSITION = auto()
    SPEED = auto()
    ELAPSED = auto()


@dataclass(frozen=True, slots=True)
class GeneratedCam:
    """A CAM and the moment of its generation; `payload` is its UPER encoding."""

    time_ns: int
    payload: bytes
    cam: Cam
    cause: Cause


class CamGenerator:
    """The CA basic service of one station.

    active_ns: when the station was switched on; the elapsed time before the first CAM counts from there, as
    in Artery. Call `check` with a state every `CHECK_INTERVAL_NS` from `first_check_ns` on.
    """

    def __init__(self, active_ns: int, rules: GenerationRules = GenerationRules()) -> None:
        self._rules = rules
        self._min_ns, self._max_ns = _ns(rules.min_interval_s), _ns(rules.max_interval_s)
        self._low_frequency_ns = _ns(rules.low_frequency_interval_s)
        self._last_ns = active_ns
        self._interval_ns = self._max_ns  # T_GenCam
        self._quiet_cams = 0
        self._last: StationState | None = None
        self._last_low_frequency_ns: int | None = None
        self._path = PathHistory()

    def forget(self) -> None:
        """Begin anew, as after a change of the station's pseudonym: without a past path or a last CAM."""
        self._path, self._last, self._last_low_frequency_ns = PathHistory(), None, None

    def remember(self, time_ns: int, place: ReferencePoint) -> None:
        """Add a place of before the first check to the path; times ascend."""
        self._path.add(time_ns, place.latitude_deg, place.longitude_deg, place.altitude_m)

    def check(self, time_ns: int, state: StationState, dcc_interval_s: float = 0.0) -> GeneratedCam | None:
        """The CAM that the station sends at this time, or None.

        state: the newest one; the CAM carries its time, not `time_ns`. dcc_interval_s: the
        minimum time between two messages that congestion control allows now. Raises CamError for a state
        that a CAM cannot represent.
        """
        self._path.add(state.time_ns, state.latitude_deg, state.longitude_deg, state.altitude_m)
        if not (cause := self._decide(time_ns, state, dcc_interval_s)):
            return None
        low_frequency = None
        last_ns = self._last_low_frequency_ns
        if last_ns is None or time_ns - last_ns >= self._low_frequency_ns:
            self._last_low_frequency_ns = time_ns
            low_frequency = self._low_frequency(state)
        cam = cam_of_state(state, low_frequency)
        return GeneratedCam(time_ns, encode_cam(cam), cam, cause)

    def _decide(self, time_ns: int, state: StationState, dcc_interval_s: float) -> Cause:
        elapsed_ns = time_ns - self._last_ns
        if elapsed_ns < min(max(_ns(dcc_interval_s), self._min_ns), self._max_ns):
            return Cause(0)
        cause = self._dynamics(state)
        if cause:
            if self._rules.low_dynamics_cams:
                self._interval_ns = min(elapsed_ns, self._max_ns)
            self._quiet_cams = 0
        elif elapsed_ns >= self._interval_ns:
            cause = Cause.ELAPSED
            self._quiet_cams += 1
            if self._quiet_cams >= self._rules.low_dynamics_cams:
                self._interval_ns = self._max_ns
        if cause:
            self._last_ns, self._last = time_ns, state
        return cause

    def _dynamics(self, state: StationState) -> Cause:
        last, rules, cause = self._last, self._rules, Cause(0)
        if last is None:
            return Cause.FIRST
        if abs(math.remainder(state.heading_rad - last.heading_rad, math.tau)) > rules.heading_change_rad:
            cause |= Cause.HEADING
        place = state.latitude_deg, state.longitude_deg
        moved_m = math.hypot(*east_north_m(last.latitude_deg, last.longitude_deg, *place))
        if moved_m > rules.position_change_m:
            cause |= Cause.POSITION
        if abs(state.speed_mps - last.speed_mps) > rules.speed_change_mps:
            cause |= Cause.SPEED
        return cause

    def _low_frequency(self, state: StationState) -> LowFrequency:
        place = state.latitude_deg, state.longitude_deg, state.altitude_m, state.time_ns
        return LowFrequency(
            vehicle_role=state.vehicle_role,
            exterior_lights=state.exterior_lights,
            path_history=self._path.points(*place)[: self._rules.path_points],
        )


def switched_on_ns(first_seen_ns: int, drive_begin_ns: int, seed: int, vehicle: str) -> int:
    """When a vehicle's station is switched on: when it appears, or within `START_NS` of the drive's start.

    Otherwise all stations of the first step would send simultaneously.
    """
    if first_seen_ns != drive_begin_ns:
        return first_seen_ns
    return first_seen_ns + int(named_generator(seed, "v2x", "switched on", vehicle).integers(START_NS))


def first_check_ns(active_ns: int, seed: int, station_id: int) -> int:
    """The first check of a station: at a random phase, 0.1 to 0.2 s after it was switched on.

    Stations are synchronised neither with each other nor with the steps of the simulation.
    """
    rng = named_generator(seed, "v2x/check-phase", station_id)
    return active_ns + CHECK_INTERVAL_NS + int(rng.integers(CHECK_INTERVAL_NS))


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
