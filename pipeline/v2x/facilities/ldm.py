"""The Local Dynamic Map: a vehicle's knowledge of other stations from received CAMs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.codec.timestamps import generation_time_ns
from advpipe.pipeline.v2x.facilities.cam import Cam, CamCore
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject, HeardObjects
from advpipe.pipeline.v2x.facilities.verdict import Verdict as Verdict
from advpipe.pipeline.v2x.section import LdmRules

_NORTHWARD_DEG = 1e-4


class LdmReport(NamedTuple):
    """The content of a CAM in the map's frame; the same for all its receivers.

    generation_ns: UTC since 1970. front_m: x, y, z of the ground below the middle of the vehicle's front
    side, in the map's frame. yaw_rad: from +x to +y. NaN where the CAM states no value, infinity where it
    states "out of range".
    """

    station_id: int
    station_type: int
    generation_ns: int
    front_m: tuple[float, float, float]
    yaw_rad: float
    speed_mps: float
    length_m: float
    width_m: float

    @property
    def centre_m(self) -> tuple[float, float, float]:
        """The ground below the centre of its box; the front where direction or length are not stated."""
        back_m = self.length_m / 2
        if not math.isfinite(back_m + self.yaw_rad):
            return self.front_m
        x_m, y_m, z_m = self.front_m
        return x_m - back_m * math.cos(self.yaw_rad), y_m - back_m * math.sin(self.yaw_rad), z_m


def report_of_cam(cam: Cam | CamCore, received_ns: int, geodesy: Geodesy) -> LdmReport | None:
    """The content of a CAM in the map's frame; None without a position, or for one on the other side of the
    Earth.

    Without an altitude it is on the map's zero level. Of the times that match its generationDeltaTime,
    the one nearest to `received_ns` is used.
    """
    return reports_of_cams([cam], [received_ns], geodesy)[0]


def reports_of_cams(
    cams: Sequence[Cam | CamCore], received_ns: Sequence[int], geodesy: Geodesy
) -> list[LdmReport | None]:
    """`report_of_cam` of each CAM; projecting many positions costs little more time than one."""
    stated = [(cam.latitude_deg, cam.longitude_deg, cam.altitude_m) for cam in cams]
    places = np.array(stated, np.float64).reshape(-1, 3)  # None is NaN
    with np.errstate(invalid="ignore"):
        (valid,) = np.nonzero((np.abs(places[:, 0]) < 90) & (np.abs(places[:, 1]) <= 180))
    places = places[valid].T
    is_flat = ~np.isfinite(places[2])
    if is_flat.any():
        places[2, is_flat] = geodesy.to_geographic([0.0, 0.0, 0.0])[2]
    both = np.concatenate([places, places], axis=1)
    both[0, len(valid) :] += _NORTHWARD_DEG
    both_m = geodesy.to_map(both).T.tolist()
    reports: list[LdmReport | None] = [None] * len(cams)
    for index, front_m, north_m in zip(valid.tolist(), both_m, both_m[len(valid) :], strict=False):
        if math.isfinite(front_m[0] + front_m[1]):  # the projection covers one side of the Earth
            reports[index] = _report(cams[index], received_ns[index], front_m, north_m)
    return reports


def _report(cam: Cam | CamCore, received_ns: int, front_m: list[float], north_m: list[float]) -> LdmReport:
    """north_m: a position slightly north of the front."""
    x_m, y_m, z_m = front_m
    yaw_rad = math.atan2(north_m[1] - y_m, north_m[0] - x_m) - _number(cam.heading_rad)
    return LdmReport(
        cam.station_id,
        cam.station_type,
        generation_time_ns(cam.generation_delta_time_ms, received_ns),
        (x_m, y_m, z_m),
        math.remainder(yaw_rad, math.tau) if math.isfinite(yaw_rad) else math.nan,
        _number(cam.speed_mps),
        _number(cam.length_m),
        _number(cam.width_m),
    )


class Entry(NamedTuple):
    """The current report of a station, and when it was received."""

    report: LdmReport
    received_ns: int


@dataclass(frozen=True)
class LdmSnapshot:
    """All entries at one time, sorted by station id, as received and not extrapolated.

    verdicts: how many CAMs have had each verdict so far. heard: objects that other stations report in CPMs,
    by station and object.
    """

    time_ns: int
    entries: tuple[Entry, ...]
    verdicts: dict[Verdict, int]
    heard: tuple[HeardObject, ...] = ()

    def age_s(self, entry: Entry) -> float:
        """Time since the entry's generation."""
        return (self.time_ns - entry.report.generation_ns) / 1e9


class LocalDynamicMap:
    """One entry for each station id: the last report, until it expires.

    A report is accepted unless its generation time is older than entries are kept or as far in the
    future, as in Artery. With `keep: newest`, a report generated before the existing one is rejected;
    with `latest` it replaces that one, as in Artery. Station ids are trusted, even the vehicle's own. Objects
    heard of in CPMs are kept apart, for `heard_kept_s`.

    clock_error_ns: by how much the vehicle's clock, with which it judges generation times, is fast.
    """

    def __init__(self, rules: LdmRules, heard_kept_s: float = 1.5, clock_error_ns: int = 0) -> None:
        self._clock_error_ns = clock_error_ns
        self._keep_ns = round(rules.expiry_s * 1e9)
        self._replaces_newer = rules.keep == "latest"
        self._entries: dict[int, Entry] = {}
        self._verdicts: Counter[Verdict] = Counter()
        self._heard = HeardObjects(heard_kept_s)

    def hear(self, objects: Sequence[HeardObject] | None, received_ns: int) -> Verdict:
        """Process the objects of a received CPM; None stands for one without a position."""
        return self._heard.receive(objects, received_ns)

    def receive(self, report: LdmReport | None, received_ns: int) -> Verdict:
        """Process a received CAM's report; None stands for a CAM without a position."""
        verdict = Verdict.UNPLACED if report is None else self._judge(report, received_ns)
        if report is not None and verdict is Verdict.ACCEPTED:
            self._entries[report.station_id] = Entry(report, received_ns)
        self._verdicts[verdict] += 1
        return verdict

    def receive_corrupt(self) -> Verdict:
        """Count a received message that is not a CAM."""
        self._verdicts[Verdict.CORRUPT] += 1
        return Verdict.CORRUPT

    def snapshot(self, now_ns: int) -> LdmSnapshot:
        """Remove expired entries, and return the others."""
        self._entries = {
            station: entry
            for station, entry in sorted(self._entries.items())
            if not self._is_expired(entry.report, now_ns)
        }
        counts = {verdict: self._verdicts[verdict] for verdict in Verdict}
        return LdmSnapshot(now_ns, tuple(self._entries.values()), counts, self._heard.snapshot(now_ns))

    def _judge(self, report: LdmReport, now_ns: int) -> Verdict:
        own_ns, generation_ns = now_ns + self._clock_error_ns, report.generation_ns
        if generation_ns < own_ns - self._keep_ns:
            return Verdict.EXPIRED
        if generation_ns > own_ns + self._keep_ns:
            return Verdict.FUTURE
        known = self._entries.get(report.station_id)
        if known is None or self._replaces_newer or self._is_expired(known.report, now_ns):
            return Verdict.ACCEPTED
        is_older = generation_ns < known.report.generation_ns
        return Verdict.SUPERSEDED if is_older else Verdict.ACCEPTED

    def _is_expired(self, report: LdmReport, now_ns: int) -> bool:
        return report.generation_ns + self._keep_ns < now_ns + self._clock_error_ns


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
