"""The misbehaviour detector: checks a receiver's messages in order of arrival and flags untrustworthy ones.

Rule: a message is flagged if any check's statistic is above its threshold. A message that continues a flagged
message rather than the station's trusted ones is flagged as well (`branch`), so that a false position is not
trusted for being repeated; a masquerader's messages do not taint the genuine ones of the same station id.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.misbehaviour import checks
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import (
    CHECKS,
    GRIP_MPS2,
    NEED_ROADS,
    OF_ACCELERATION,
    DetectorConfig,
    Expectation,
)
from advpipe.pipeline.misbehaviour.track import Track
from advpipe.pipeline.misbehaviour.verdicts import CheckVerdicts, Verdicts

_NEAR_M = 60.0
"""No box reaches so far, with a second of motion."""


class Judgement(NamedTuple):
    """Of M messages: statistics (M, C), columns in the order of `CHECKS`, and which are flagged (M,)."""

    statistics: Float64
    flagged: npt.NDArray[np.bool_]

    def triggered(self, config: DetectorConfig) -> npt.NDArray[np.bool_]:
        """Which checks triggered, (M, C)."""
        limits = [config.thresholds.get(name, math.inf) for name in CHECKS]
        with np.errstate(invalid="ignore"):
            return np.asarray(self.statistics > np.array(limits))


@dataclass
class _StationMemory:
    """The memory of one station id: its trusted messages, and its suspect ones."""

    trusted: Track | None = None
    suspect: Track | None = None


class OnlineDetector:
    """Keeps a receiver's memory of all stations; `judge` takes one message after the other.

    >>> detector = OnlineDetector(config)
    >>> statistics, is_flagged = detector.judge(claim, receiver)
    """

    def __init__(self, config: DetectorConfig) -> None:
        self._config = config
        self._limits = [config.thresholds.get(name, math.inf) for name in CHECKS]
        self._stations: dict[int, _StationMemory] = {}
        self._first_ns: int | None = None
        self._swept_ns = 0

    def judge(self, claim: Claim, receiver: ReceivingVehicle) -> tuple[list[float], bool]:
        """Statistics in the order of `CHECKS`, and whether the message is flagged."""
        if self._first_ns is None:
            self._first_ns = claim.arrival_ns
        values = dict.fromkeys(CHECKS, math.nan)
        values["decoding"], values["format"] = float(not claim.is_cam), float(claim.invalid)
        if not claim.is_cam or not math.isfinite(claim.x_m):
            return list(values.values()), self._is_bad(list(values.values()))
        self._sweep(claim)
        station = self._stations.setdefault(claim.station_id, _StationMemory())
        self._forget(station, claim)
        track, continues_suspect = self._track(station, claim)
        values["branch"] = float(continues_suspect)
        self._measure_alone(values, claim, receiver)
        if track is None:
            is_settled = (claim.arrival_ns - self._first_ns) / 1e9 > self._config.settle_s
            if is_settled and not claim.may_be_known:
                values["appearance"] = checks.appearance_m(claim, receiver, self._config.earshot_m)
        else:
            self._measure_change(values, claim, track)
            self._measure_newest(values, claim, station)
        known = station.trusted or station.suspect
        if known is not None:
            values["frequency"] = checks.frequency_hz(claim, known.last)
            values["identity"] = max(values["identity"], float(claim.station_type != known.last.station_type))
        values["overlap"] = self._overlap(claim, receiver, station)
        statistics = list(values.values())
        is_bad = self._is_bad(statistics)
        self._remember(station, claim, track, continues_suspect, is_bad, statistics)
        return statistics, is_bad

    def _is_bad(self, statistics: Sequence[float]) -> bool:
        return any(value > limit for value, limit in zip(statistics, self._limits, strict=True))

    def _sweep(self, claim: Claim) -> None:
        """Forgets silent stations now and then: a flooding attack uses thousands of ids."""
        if claim.arrival_ns - self._swept_ns > self._config.memory_s * 1e9:
            self._swept_ns = claim.arrival_ns
            for station in self._stations.values():
                self._forget(station, claim)
            self._stations = {n: one for n, one in self._stations.items() if one.trusted or one.suspect}

    def _forget(self, station: _StationMemory, claim: Claim) -> None:
        memory_ns = self._config.memory_s * 1e9
        if station.trusted is not None and claim.arrival_ns - station.trusted.last.arrival_ns > memory_ns:
            station.trusted = None
        if station.suspect is not None and claim.arrival_ns - station.suspect.last.arrival_ns > memory_ns:
            station.suspect = None

    def _track(self, station: _StationMemory, claim: Claim) -> tuple[Track | None, bool]:
        """The track that this message continues, and whether that track is suspect."""
        trusted, suspect = station.trusted, station.suspect
        if trusted is None or suspect is None:
            return trusted or suspect, trusted is None and suspect is not None
        expected = self._config.expectation
        limit = self._config.thresholds.get("position_speed", math.inf)
        to_trusted = _fit(claim, trusted.last, expected)
        to_suspect = _fit(claim, suspect.last, expected)
        # A message that fits the trusted track is trusted, even if it fits the suspect one as well.
        return (suspect, True) if to_suspect <= limit < to_trusted else (trusted, False)

    def _measure_alone(self, values: dict[str, float], claim: Claim, receiver: ReceivingVehicle) -> None:
        values["identity"] = float(claim.station_id == receiver.station_id)
        values["range"] = checks.claimed_range_m(claim, receiver)
        values["speed"] = abs(claim.speed_mps)
        values["position"] = claim.off_road_m
        if abs(claim.speed_mps) >= checks.MIN_SPEED_MPS:
            values["wrong_way"] = claim.wrong_way_rad
        values["freshness"] = checks.freshness_s(claim)
        values["dynamics"] = checks.dynamics_mps2(claim, None)

    def _measure_change(self, values: dict[str, float], claim: Claim, track: Track) -> None:
        expected, last = self._config.expectation, track.last
        values["size"] = checks.size_m(claim, last)
        if checks.elapsed_s(claim, last) <= 0:  # `frequency` triggers; nothing else can be compared
            return
        values["position_speed"] = checks.position_speed_sigma(claim, last, expected)
        values["drift"] = track.drift(claim, self._config)
        values["heading"] = checks.heading_sigma(claim, last, expected)
        values["turn"] = checks.turn_sigma(claim, last, expected)
        values["acceleration"] = checks.acceleration_sigma(claim, last, expected)
        values["dynamics"] = checks.dynamics_mps2(claim, last)
        values["impulse"] = track.impulse(claim, self._config)
        values["kalman"] = track.innovation(claim)

    def _measure_newest(self, values: dict[str, float], claim: Claim, station: _StationMemory) -> None:
        """Of a message that continues both tracks, the speed is compared with the newest message of either:
        the trusted one may be too old to tell a false speed."""
        trusted, suspect = station.trusted, station.suspect
        if trusted is None or suspect is None or suspect.last.generation_ns <= trusted.last.generation_ns:
            return
        expected = self._config.expectation
        if _fit(claim, suspect.last, expected) <= self._config.thresholds.get("position_speed", math.inf):
            newest = checks.acceleration_sigma(claim, suspect.last, expected)
            values["acceleration"] = float(np.fmax(values["acceleration"], newest))

    def _overlap(self, claim: Claim, receiver: ReceivingVehicle, own: _StationMemory) -> float:
        """Overlap with the receiver and with trusted stations; of two stations, the newer one is flagged."""
        box = checks.claimed_box(claim, claim.arrival_ns)
        if box is None:
            return math.nan
        others: list[tuple[float, ...]] = [
            (receiver.x_m, receiver.y_m, 0.0, receiver.length_m, receiver.width_m, 1.0, receiver.yaw_rad)
        ]
        x_m, y_m, at_ns = claim.x_m, claim.y_m, claim.arrival_ns
        least = max(own.trusted.length if own.trusted is not None else 0, 2)
        for other in self._stations.values():
            track = other.trusted
            if track is None or track.length < least or other is own:
                continue
            last = track.last
            if abs(last.x_m - x_m) > _NEAR_M or abs(last.y_m - y_m) > _NEAR_M:
                continue
            if (at_ns - last.arrival_ns) / 1e9 > 1.0:
                continue
            if (theirs := checks.claimed_box(last, at_ns)) is not None:
                others.append(theirs)
        return checks.overlap_share(box, others, self._config.expectation.apart_m)

    def _remember(
        self,
        station: _StationMemory,
        claim: Claim,
        track: Track | None,
        continues_suspect: bool,
        is_bad: bool,
        statistics: Sequence[float],
    ) -> None:
        config, at_ns = self._config, claim.arrival_ns
        if not is_bad:
            if track is None or track is not station.trusted:
                station.trusted = track = Track(config)
            track.add(claim)
            return
        faults = {
            name: value
            for name, value, limit in zip(CHECKS, statistics, self._limits, strict=True)
            if value > limit and name != "branch"
        }
        if continues_suspect and station.suspect is not None:
            suspect = station.suspect
            if checks.elapsed_s(claim, suspect.last) <= 0:
                self._blame(suspect, faults, at_ns)
                return
            suspect.add(claim)
            if faults:
                self._blame(suspect, faults, at_ns)
            elif (at_ns - suspect.last_fault_ns) / 1e9 >= suspect.pardon_s:
                station.trusted, station.suspect = suspect, None
            return
        station.suspect = Track(config)
        station.suspect.add(claim)
        self._blame(station.suspect, faults, at_ns)

    def _blame(self, suspect: Track, faults: Mapping[str, float], at_ns: int) -> None:
        """Distrust a track from now on, the longer the more speaks against it."""
        suspect.last_fault_ns, suspect.pardon_s = at_ns, max(suspect.pardon_s, self._pardon_s(faults))

    def _pardon_s(self, faults: Mapping[str, float]) -> float:
        if faults.keys() <= set(NEED_ROADS):
            return self._config.road_pardon_s
        if faults.keys() <= set(OF_ACCELERATION) and faults.get("dynamics", 0.0) <= GRIP_MPS2:
            return self._config.acceleration_pardon_s
        return self._config.pardon_s


def judge_all(
    claims: Sequence[Claim], receivers: Sequence[ReceivingVehicle], config: DetectorConfig
) -> Judgement:
    """Check all messages of one receiver, in order of arrival, with the receiver's own pose at each."""
    detector = OnlineDetector(config)
    statistics = np.full((len(claims), len(CHECKS)), np.nan)
    flagged = np.zeros(len(claims), bool)
    for row, (claim, receiver) in enumerate(zip(claims, receivers, strict=True)):
        statistics[row], flagged[row] = detector.judge(claim, receiver)
    return Judgement(statistics, flagged)


class PlausibilityDetector:
    """Our checks as a misbehaviour detector.

    The score of a message is the largest ratio of a check's statistic to its threshold: above 1 it is
    flagged. What later messages are compared with depends on what was flagged, at the thresholds of the
    settings.
    """

    def __init__(self, config: DetectorConfig | None = None) -> None:
        self.config = config or DetectorConfig()

    def judge(self, claims: Sequence[Claim], receivers: Sequence[ReceivingVehicle]) -> Verdicts:
        found = judge_all(claims, receivers, self.config)
        triggered = found.triggered(self.config)
        limits = np.array([self.config.thresholds.get(name, math.inf) for name in CHECKS])
        ratios = np.nan_to_num(found.statistics / limits, nan=0.0, posinf=np.finfo(float).max)
        return Verdicts(
            ratios.max(axis=1, initial=0.0),
            found.flagged,
            {
                name: CheckVerdicts(found.statistics[:, number], triggered[:, number])
                for number, name in enumerate(CHECKS)
            },
        )


def _fit(claim: Claim, last: Claim, expected: Expectation) -> float:
    """How well a message continues another, in sigma; infinite where it is incomplete or was generated
    earlier."""
    if checks.elapsed_s(claim, last) <= 0:
        return math.inf
    found = checks.position_speed_sigma(claim, last, expected)
    return found if math.isfinite(found) else math.inf
