"""Messages that attackers overhear and replay, and their generation times."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.labels.claims import Claim
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.pipeline.v2x.codec.timestamps import GENERATION_DELTA_TIME_CYCLE_MS, NS_PER_MS
from advpipe.stages.attack.v2x.cams import field_of, with_fields

RECEPTION_RANGE_M = 400.0
"""The range of most messages under the default radio, as in VeReMi NextGen."""


class OverheardMessages:
    """The messages of other stations within a distance of each listener, stored for a limited time.

    Distance approximates reception, because the radio model runs only after all editors. kept: messages of
    each station, at most; without a limit if left out.
    """

    def __init__(
        self, listeners: Sequence[int], range_m: float, memory_s: float, kept: int | None = None
    ) -> None:
        self._listeners, self._range_m, self._kept = listeners, range_m, kept
        self._memory_ns = round(memory_s * 1e9)
        self._stored: dict[int, dict[int, list[Sent]]] = {listener: {} for listener in listeners}

    def listen(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """Store the messages of a step, after the step, and forget old ones."""
        near = _listeners_in_range(step.radios, self._listeners, self._range_m)
        for message in sorted(sent, key=lambda message: (message.request_ns, message.number)):
            for listener in near.get(message.station_id, ()):
                log = self._stored[listener].setdefault(message.station_id, [])
                log.append(message)
                if self._kept is not None:
                    del log[: -self._kept]
        horizon_ns = step.begin_ns - self._memory_ns
        for by_station in self._stored.values():
            for station in [station for station, log in by_station.items() if log[0].request_ns < horizon_ns]:
                log = by_station[station]
                del log[: bisect_left(log, horizon_ns, key=_time)]
                if not log:
                    del by_station[station]

    def stations(self, listener: int, before_ns: int) -> list[int]:
        """The stations with a stored message before this time, ascending."""
        return sorted(
            station for station, log in self._stored[listener].items() if log[0].request_ns < before_ns
        )

    def last(self, listener: int, station: int, before_ns: int) -> Sent | None:
        """A station's last stored message before this time; None if there is none."""
        log = self._stored[listener].get(station, [])
        place = bisect_left(log, before_ns, key=_time)
        return log[place - 1] if place else None

    def between(self, listener: int, station: int, from_ns: int, until_ns: int) -> list[Sent]:
        """A station's stored messages from one time to another, the latter excluded."""
        log = self._stored[listener].get(station, [])
        return log[bisect_left(log, from_ns, key=_time) : bisect_left(log, until_ns, key=_time)]

    def any_of(self, listener: int, rng: np.random.Generator) -> Sent | None:
        """A uniformly random stored message; None if there is none."""
        logs = [log for _, log in sorted(self._stored[listener].items())]
        ends = np.cumsum([len(log) for log in logs])
        if not logs:
            return None
        drawn = int(rng.integers(ends[-1]))
        place = bisect_right(ends.tolist(), drawn)
        return logs[place][drawn - int(ends[place])]


def with_later_time(tree: CamTree, by_ns: int) -> CamTree:
    """The CAM with a later generation time, in whole milliseconds, modulo its cycle of 65.536 s."""
    delta_ms = field_of(tree, "generation_delta_time_ms") + round(by_ns / NS_PER_MS)
    return with_fields(tree, generation_delta_time_ms=delta_ms % GENERATION_DELTA_TIME_CYCLE_MS)


def without_true_time(claims: Iterable[Claim], parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
    """The claims without the generation time, unless these parameters change it: by `ahead_s`, or without
    `restamp`."""
    is_time_untrue = bool(parameters["ahead_s"]) or not parameters.get("restamp", True)
    return tuple(claim for claim in claims if claim != "generation time" or is_time_untrue)


def _time(message: Sent) -> int:
    return message.request_ns


def _listeners_in_range(
    radios: Sequence[RadioPlace], listeners: Sequence[int], range_m: float
) -> dict[int, tuple[int, ...]]:
    """For each station on the road, the other listeners on the road within a distance."""
    ids = [radio.station_id for radio in radios]
    present = [listener for listener in listeners if listener in set(ids)]
    if not present:
        return {}
    places_m = np.array([radio.map_SE3_base[:3, 3] for radio in radios])
    listeners_m = places_m[[ids.index(listener) for listener in present]]
    distance_m = np.linalg.norm(places_m[:, None] - listeners_m[None], axis=-1)
    return {
        station: tuple(
            listener
            for listener, is_near in zip(present, row, strict=True)
            if is_near and listener != station
        )
        for station, row in zip(ids, (distance_m <= range_m).tolist(), strict=True)
    }
