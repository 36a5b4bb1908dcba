"""What the radio did in a drive: reception by distance, CAM rates, channel load."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.load import ChannelLoad
from advpipe.pipeline.v2x.radio.medium import Step
from advpipe.pipeline.v2x.radio.stations import Fates, Int64, Outcome

BIN_M = 50.0
BINS = 30
INTERVAL_BIN_S = 0.05
INTERVAL_BINS = 24


def delivery_by_distance(
    distance_m: Float64, is_received: npt.NDArray[np.bool_], bin_m: float = BIN_M, bins: int = BINS
) -> tuple[Int64, Int64]:
    """Pairs (bins,) of message and receiver, and those received, for each `bin_m` of distance from zero."""
    nth = np.minimum(distance_m / bin_m, bins).astype(np.int64)
    pairs = np.bincount(nth, minlength=bins + 1)[:bins]
    return pairs, np.bincount(nth[is_received], minlength=bins + 1)[:bins]


@dataclass(frozen=True)
class Statistics:
    """A drive's V2X in numbers.

    pairs, received: of message and receiver, for each `BIN_M` of distance. outcomes: pairs by the name of
    their `Outcome`. delay_mean_s, delay_max_s: from handing over to arrival; 0 without any.
    stations, cams: that sent, and what they sent. rates_hz: of each station that sent twice or more,
    ascending. intervals: CAMs by the time since the station's last one, for each `INTERVAL_BIN_S`; the last
    bin holds all longer ones. dropped: never sent. busy_ns, busy_mean, busy_max: ends of windows, channel
    busy ratio over stations.
    """

    pairs: tuple[int, ...]
    received: tuple[int, ...]
    outcomes: dict[str, int]
    delay_mean_s: float
    delay_max_s: float
    stations: int
    cams: int
    dropped: int
    rates_hz: tuple[float, ...]
    intervals: tuple[int, ...]
    busy_ns: tuple[int, ...]
    busy_mean: tuple[float, ...]
    busy_max: tuple[float, ...]

    @property
    def delivery_ratio(self) -> Float64:
        """Share received for each `BIN_M` of distance; NaN where nobody was."""
        pairs, received = np.array(self.pairs, np.float64), np.array(self.received, np.float64)
        ratio = np.full(len(pairs), np.nan)
        np.divide(received, pairs, out=ratio, where=pairs > 0)
        return ratio

    def lines(self) -> list[tuple[str, str]]:
        """A summary: what, and how much."""
        rates, ratio = self.rates_hz, self.delivery_ratio
        near = [
            f"{100 * ratio[last]:.0f} % at {BIN_M * last:.0f} to {BIN_M * (last + 1):.0f} m"
            for last in (0, 1, 3, 9)
            if self.pairs[last]
        ]
        lines = [("CAMs", f"{self.cams} of {self.stations} stations")]
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
        return lines

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Statistics:
        """Raises ValueError for a text that is none."""
        try:
            tree: dict[str, Any] = json.loads(text)
            values: dict[str, Any] = {
                name: tuple(value) if isinstance(value, list) else value for name, value in tree.items()
            }
            return cls(**values)
        except (TypeError, AttributeError) as error:
            raise ValueError(f"no statistics of V2X: {error}") from None


@dataclass
class _Sender:
    """What is kept of a station that sends."""

    first_ns: int
    last_ns: int
    cams: int = 1

    @property
    def rate_hz(self) -> float:
        return (self.cams - 1) * 1e9 / (self.last_ns - self.first_ns)


def _counts(bins: int) -> Int64:
    return np.zeros(bins, np.int64)


@dataclass
class Tally:
    """Counts while the drive goes on; besides a few numbers a station and window, its memory stays flat."""

    _pairs: Int64 = field(default_factory=lambda: _counts(BINS))
    _received: Int64 = field(default_factory=lambda: _counts(BINS))
    _outcomes: Int64 = field(default_factory=lambda: _counts(len(Outcome)))
    _intervals: Int64 = field(default_factory=lambda: _counts(INTERVAL_BINS))
    _delay_sum_ns: int = 0
    _delay_max_ns: int = 0
    _dropped: int = 0
    _senders: dict[int, _Sender] = field(default_factory=dict)
    _loads: list[tuple[int, float, float]] = field(default_factory=list)

    def add(self, step: Step) -> None:
        """Counts what became known in a step of the medium."""
        fates = step.fates
        is_received = fates.outcome == Outcome.RECEIVED
        outcomes = np.bincount(fates.outcome.ravel(), minlength=len(Outcome))
        pairs, received = delivery_by_distance(fates.distance_m.ravel(), is_received.ravel())
        pairs[0] -= outcomes[Outcome.OWN]  # who sends is no distance from itself
        self._pairs += pairs
        self._received += received
        self._outcomes += outcomes
        row, column = np.nonzero(is_received)
        delays_ns = fates.arrival_ns[row, column] - fates.request_ns[row]
        self._delay_sum_ns += int(delays_ns.sum())
        self._delay_max_ns = max(self._delay_max_ns, int(delays_ns.max(initial=0)))
        self._dropped += len(fates.dropped)
        self._add_senders(fates)
        for load in step.loads:
            self._add_load(load)

    def statistics(self) -> Statistics:
        """All that has been counted."""
        received = int(self._outcomes[Outcome.RECEIVED])
        senders = self._senders.values()
        return Statistics(
            pairs=tuple(self._pairs.tolist()),
            received=tuple(self._received.tolist()),
            outcomes={outcome.name.lower(): int(self._outcomes[outcome]) for outcome in Outcome},
            delay_mean_s=self._delay_sum_ns / received / 1e9 if received else 0.0,
            delay_max_s=self._delay_max_ns / 1e9,
            stations=len(senders),
            cams=sum(sender.cams for sender in senders),
            dropped=self._dropped,
            rates_hz=tuple(sorted(sender.rate_hz for sender in senders if sender.last_ns > sender.first_ns)),
            intervals=tuple(self._intervals.tolist()),
            busy_ns=tuple(load[0] for load in self._loads),
            busy_mean=tuple(load[1] for load in self._loads),
            busy_max=tuple(load[2] for load in self._loads),
        )

    def _add_senders(self, fates: Fates) -> None:
        order = np.argsort(fates.request_ns, kind="stable")
        for station, time_ns in zip(
            fates.senders[order].tolist(), fates.request_ns[order].tolist(), strict=True
        ):
            sender = self._senders.get(station)
            if sender is None:
                self._senders[station] = _Sender(time_ns, time_ns)
                continue
            bin_of = math.floor((time_ns - sender.last_ns) / 1e9 / INTERVAL_BIN_S + 1e-6)
            self._intervals[min(max(bin_of, 0), INTERVAL_BINS - 1)] += 1
            sender.last_ns, sender.cams = max(time_ns, sender.last_ns), sender.cams + 1

    def _add_load(self, load: ChannelLoad) -> None:
        if len(load.busy_ratio):
            mean, most = float(load.busy_ratio.mean()), float(load.busy_ratio.max())
            self._loads.append((load.end_ns, mean, most))
