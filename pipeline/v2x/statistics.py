"""V2X statistics of a drive: reception by distance, CAM rates, channel load."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from advpipe.pipeline.core.text import counted
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.message_type import CAM
from advpipe.pipeline.v2x.radio.load import ChannelLoad
from advpipe.pipeline.v2x.radio.medium import Step
from advpipe.pipeline.v2x.radio.stations import RECEIVED, Bool, Int64, Outcome, ReceptionOutcomes

BIN_M = 50.0
BINS = 30
INTERVAL_BIN_S = 0.05
INTERVAL_BINS = 24
_OUTCOMES = len(Outcome)


_MOST_VALUES = 1_000_000
_Count = Annotated[int, Field(strict=True, ge=0, lt=2**63)]
_Bins = Annotated[tuple[_Count, ...], Field(min_length=1, max_length=1000)]
_Quantity = Annotated[float, Field(strict=True, ge=0, le=1e9, allow_inf_nan=False)]
_Share = Annotated[float, Field(strict=True, ge=0, le=1.001, allow_inf_nan=False)]
_OutcomeName = Annotated[str, Field(max_length=50)]


def delivery_by_distance(
    distance_m: Float64, is_received: npt.NDArray[np.bool_], bin_m: float = BIN_M, bins: int = BINS
) -> tuple[Int64, Int64]:
    """Counts (bins,) of message-receiver pairs, and of received ones, per `bin_m` of distance."""
    nth = np.minimum(distance_m / bin_m, bins).astype(np.int64)
    pairs = np.bincount(nth, minlength=bins + 1)[:bins]
    return pairs, np.bincount(nth[is_received], minlength=bins + 1)[:bins]


@dataclass(frozen=True)
class Statistics:
    """V2X statistics of a drive.

    pairs, received: message-receiver pairs per `BIN_M` of distance. outcomes: pairs by the name of
    their `Outcome`. delay_mean_s, delay_max_s: from request to arrival; 0 without any reception.
    stations, cams: sending stations, and CAMs sent. rates_hz: of each station that sent twice or more,
    ascending. intervals: CAMs by the time since the station's last one, per `INTERVAL_BIN_S`; the last
    bin holds all longer ones. dropped: never sent. busy_ns, busy_mean, busy_max: ends of windows, channel
    busy ratio over stations. others: messages handed to radios that are no CAMs, by type. rejected: messages
    that reached instrumented vehicles and that their layers below the facilities rejected, by reason.
    """

    pairs: _Bins
    received: _Bins
    outcomes: dict[_OutcomeName, _Count]
    delay_mean_s: _Quantity
    delay_max_s: _Quantity
    stations: _Count
    cams: _Count
    dropped: _Count
    rates_hz: Annotated[tuple[_Quantity, ...], Field(max_length=_MOST_VALUES)]
    intervals: _Bins
    busy_ns: Annotated[tuple[_Count, ...], Field(max_length=_MOST_VALUES)]
    busy_mean: Annotated[tuple[_Share, ...], Field(max_length=_MOST_VALUES)]
    busy_max: Annotated[tuple[_Share, ...], Field(max_length=_MOST_VALUES)]
    others: Annotated[dict[_OutcomeName, _Count], Field(max_length=100)] = field(default_factory=dict)
    rejected: Annotated[dict[_OutcomeName, _Count], Field(max_length=100)] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raises ValueError for inconsistent columns: recordings are untrusted input."""
        if len(self.pairs) != len(self.received) or any(map(int.__gt__, self.received, self.pairs)):
            raise ValueError("more was received than sent")
        if not len(self.busy_ns) == len(self.busy_mean) == len(self.busy_max):
            raise ValueError("busy_ns, busy_mean and busy_max have different lengths")
        if list(self.rates_hz) != sorted(self.rates_hz):
            raise ValueError("rates_hz is not ascending")

    @property
    def delivery_ratio(self) -> Float64:
        """Share received per `BIN_M` of distance; NaN where no station was."""
        pairs, received = np.array(self.pairs, np.float64), np.array(self.received, np.float64)
        ratio = np.full(len(pairs), np.nan)
        np.divide(received, pairs, out=ratio, where=pairs > 0)
        return ratio

    def lines(self) -> list[tuple[str, str]]:
        """A summary: names and values."""
        rates, ratio = self.rates_hz, self.delivery_ratio
        near = [
            f"{100 * ratio[last]:.0f} % at {BIN_M * last:.0f} to {BIN_M * (last + 1):.0f} m"
            for last in (0, 1, 3, 9)
            if self.pairs[last]
        ]
        lines = [("CAMs", f"{self.cams} of {counted(self.stations, 'station')}")]
        lines += [(f"{name.upper()}s", f"{count}") for name, count in self.others.items()]
        if rates:
            mean = sum(rates) / len(rates)
            lines.append(("CAM rate", f"{mean:.1f} Hz on average, {rates[0]:.1f} to {rates[-1]:.1f} Hz"))
        if near:
            lines.append(("packets delivered", ", ".join(near)))
        if self.busy_mean:
            mean = sum(self.busy_mean) / len(self.busy_mean)
            lines.append(
                ("channel busy", f"{100 * mean:.1f} % on average, {100 * max(self.busy_max):.1f} % at most")
            )
        if self.dropped:
            lines.append(("CAMs dropped", f"{self.dropped}, never sent"))
        if self.rejected:
            reasons = sorted(self.rejected.items(), key=lambda item: (-item[1], item[0]))
            lines.append(("messages rejected", ", ".join(f"{count} {reason}" for reason, count in reasons)))
        return lines

    def without_reasons(self) -> Statistics:
        """These, where nobody knows why a message did not reach a station: it is `lost`."""
        kept = {name: self.outcomes[name] for name in ("received", "own")}
        lost = sum(self.outcomes.values()) - sum(kept.values())
        return replace(self, outcomes={**kept, "lost": lost})

    def to_json(self) -> str:
        """All values as one JSON document; without `others` and `rejected` where there are none."""
        rare = ("others", "rejected")
        return json.dumps({name: value for name, value in asdict(self).items() if value or name not in rare})


def _outcomes_by_distance(distance_m: Float64, outcome: npt.NDArray[np.uint8]) -> Int64:
    """Counts (BINS + 1, outcomes) of message-receiver pairs; the last row has those farther away."""
    nth = np.minimum(distance_m / BIN_M, BINS).astype(np.int32)
    nth *= _OUTCOMES
    nth += outcome
    counts = np.bincount(nth, minlength=(BINS + 1) * _OUTCOMES)
    return counts.reshape(BINS + 1, _OUTCOMES)


def _counts(bins: int) -> Int64:
    return np.zeros(bins, np.int64)


@dataclass
class Tally:
    """Counts during a drive; apart from a few numbers per station and window, its memory stays constant."""

    _pairs: Int64 = field(default_factory=lambda: _counts(BINS))
    _received: Int64 = field(default_factory=lambda: _counts(BINS))
    _outcomes: Int64 = field(default_factory=lambda: _counts(len(Outcome)))
    _intervals: Int64 = field(default_factory=lambda: _counts(INTERVAL_BINS))
    _delay_sum_ns: int = 0
    _delay_max_ns: int = 0
    _dropped: int = 0
    _first_ns: dict[int, int] = field(default_factory=dict)
    _latest_ns: dict[int, int] = field(default_factory=dict)
    _cams: Counter[int] = field(default_factory=Counter)
    _loads: list[tuple[int, float, float]] = field(default_factory=list)
    _others: Counter[str] = field(default_factory=Counter)
    _rejected: Counter[str] = field(default_factory=Counter)

    def count(self, names: Iterable[str]) -> None:
        """Count messages that stations hand to their radios, by the names of their types."""
        self._others.update(name for name in names if name != CAM.name)

    def reject(self, reasons: Iterable[str]) -> None:
        """Count receptions that a vehicle's lower layers rejected, by reason."""
        self._rejected.update(reasons)

    def add(self, step: Step, is_cam: Bool | None = None) -> None:
        """Count the results of a step of the medium. is_cam: (M,), which messages are CAMs; None: all."""
        outcomes = step.outcomes
        outcome = outcomes.outcome.ravel()
        counts = _outcomes_by_distance(outcomes.distance_m.ravel(), outcome)
        by_outcome = counts.sum(axis=0)
        self._pairs += counts[:BINS].sum(axis=1)
        self._pairs[0] -= by_outcome[Outcome.OWN]  # the sender itself is not a pair
        self._received += counts[:BINS, RECEIVED]
        self._outcomes += by_outcome
        receptions = np.count_nonzero(outcomes.outcome == RECEIVED, axis=1)
        sent_after_ns = outcomes.end_ns - outcomes.request_ns
        self._delay_sum_ns += int(outcomes.delay_ns.sum() + receptions @ sent_after_ns)
        delay_max_ns = (sent_after_ns + outcomes.delay_ns.max(axis=1, initial=0)) * (receptions > 0)
        self._delay_max_ns = max(self._delay_max_ns, int(delay_max_ns.max(initial=0)))
        self._dropped += len(outcomes.dropped)
        self._add_senders(outcomes, np.ones(len(outcomes.messages), bool) if is_cam is None else is_cam)
        for load in step.loads:
            self._add_load(load)

    def statistics(self) -> Statistics:
        """The statistics of everything counted so far."""
        received = int(self._outcomes[Outcome.RECEIVED])
        lasted_ns = {
            station: last_ns - self._first_ns[station] for station, last_ns in self._latest_ns.items()
        }
        rates_hz = [(self._cams[station] - 1) * 1e9 / ns for station, ns in lasted_ns.items() if ns > 0]
        return Statistics(
            pairs=tuple(self._pairs.tolist()),
            received=tuple(self._received.tolist()),
            outcomes={outcome.name.lower(): int(self._outcomes[outcome]) for outcome in Outcome},
            delay_mean_s=self._delay_sum_ns / received / 1e9 if received else 0.0,
            delay_max_s=self._delay_max_ns / 1e9,
            stations=len(self._cams),
            cams=self._cams.total(),
            dropped=self._dropped,
            rates_hz=tuple(sorted(rates_hz)),
            intervals=tuple(self._intervals.tolist()),
            busy_ns=tuple(load[0] for load in self._loads),
            busy_mean=tuple(load[1] for load in self._loads),
            busy_max=tuple(load[2] for load in self._loads),
            others=dict(sorted(self._others.items())),
            rejected=dict(sorted(self._rejected.items())),
        )

    def _add_senders(self, outcomes: ReceptionOutcomes, is_cam: Bool) -> None:
        order = np.argsort(outcomes.request_ns, kind="stable")
        order = order[is_cam[order]]
        intervals_ns = []
        stations, latest_ns = outcomes.senders[order].tolist(), self._latest_ns
        self._cams.update(stations)
        for station, time_ns in zip(stations, outcomes.request_ns[order].tolist(), strict=True):
            last_ns = latest_ns.get(station)
            if last_ns is None:
                self._first_ns[station] = latest_ns[station] = time_ns
                continue
            intervals_ns.append(time_ns - last_ns)
            if time_ns > last_ns:
                latest_ns[station] = time_ns
        bins = np.floor(np.array(intervals_ns) / 1e9 / INTERVAL_BIN_S + 1e-6)
        bins = np.clip(bins, 0, INTERVAL_BINS - 1).astype(np.int64)
        self._intervals += np.bincount(bins, minlength=INTERVAL_BINS)

    def _add_load(self, load: ChannelLoad) -> None:
        if len(load.busy_ratio):
            mean, most = float(load.busy_ratio.mean()), float(load.busy_ratio.max())
            self._loads.append((load.end_ns, mean, most))
