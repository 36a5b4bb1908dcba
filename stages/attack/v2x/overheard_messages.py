"""What attackers overhear of others' messages, and what becomes of one's generation time."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.pipeline.v2x.codec.timestamps import GENERATION_DELTA_TIME_CYCLE_MS, NS_PER_MS
from advpipe.stages.attack.v2x.cams import field_of, with_fields

RECEPTION_RANGE_M = 400.0
"""Far enough for most messages under the default radio, as in VeReMi NextGen."""


class OverheardMessages:
    """All that listeners have heard of others within a distance, for a while.

    A distance stands for reception: the radio decides that only after all editors are through.
    """

    def __init__(self, listeners: Sequence[int], range_m: float, memory_s: float) -> None:
        self._listeners, self._range_m = listeners, range_m
        self._memory_ns = round(memory_s * 1e9)
        self._heard: dict[int, dict[int, list[Sent]]] = {listener: {} for listener in listeners}

    def listen(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """Takes what was sent in a step, after it is over; forgets what is too old."""
        near = _within(step.radios, self._listeners, self._range_m)
        for one in sorted(sent, key=lambda one: (one.request_ns, one.number)):
            for listener in near.get(one.station_id, ()):
                self._heard[listener].setdefault(one.station_id, []).append(one)
        horizon_ns = step.begin_ns - self._memory_ns
        for heard in self._heard.values():
            for station in [station for station, log in heard.items() if log[0].request_ns < horizon_ns]:
                log = heard[station]
                del log[: bisect_left(log, horizon_ns, key=_time)]
                if not log:
                    del heard[station]

    def stations(self, listener: int, before_ns: int) -> list[int]:
        """Those of whom a message before that time is remembered, ascending."""
        return sorted(
            station for station, log in self._heard[listener].items() if log[0].request_ns < before_ns
        )

    def last(self, listener: int, station: int, before_ns: int) -> Sent | None:
        """A station's last message before that time."""
        log = self._heard[listener].get(station, [])
        place = bisect_left(log, before_ns, key=_time)
        return log[place - 1] if place else None

    def between(self, listener: int, station: int, from_ns: int, until_ns: int) -> list[Sent]:
        """A station's messages from one time up to, but not at, another."""
        log = self._heard[listener].get(station, [])
        return log[bisect_left(log, from_ns, key=_time) : bisect_left(log, until_ns, key=_time)]

    def any_of(self, listener: int, rng: np.random.Generator) -> Sent | None:
        """One of all remembered messages, each as likely as the others."""
        logs = [log for _, log in sorted(self._heard[listener].items())]
        ends = np.cumsum([len(log) for log in logs])
        if not logs:
            return None
        drawn = int(rng.integers(ends[-1]))
        place = bisect_right(ends.tolist(), drawn)
        return logs[place][drawn - int(ends[place])]


def with_later_time(tree: CamTree, by_ns: int) -> CamTree:
    """The same CAM, generated that much later; it counts whole milliseconds, in a cycle of 65.536 s."""
    delta_ms = field_of(tree, "generation_delta_time_ms") + round(by_ns / NS_PER_MS)
    return with_fields(tree, generation_delta_time_ms=delta_ms % GENERATION_DELTA_TIME_CYCLE_MS)


def is_time_untrue(parameters: Mapping[str, Any]) -> bool:
    """Whether messages of an attack with these parameters tell another time than those that they replace: by
    `ahead_s`, or without `restamp`."""
    return bool(parameters["ahead_s"]) or not parameters.get("restamp", True)


def _time(one: Sent) -> int:
    return one.request_ns


def _within(
    radios: Sequence[RadioPlace], listeners: Sequence[int], range_m: float
) -> dict[int, tuple[int, ...]]:
    """Of each station on the road, the listeners on the road within a distance, itself not."""
    ids = [radio.station_id for radio in radios]
    present = [listener for listener in listeners if listener in set(ids)]
    if not present:
        return {}
    places_m = np.array([radio.map_SE3_base[:3, 3] for radio in radios])
    ears_m = places_m[[ids.index(listener) for listener in present]]
    distance_m = np.linalg.norm(places_m[:, None] - ears_m[None], axis=-1)
    return {
        station: tuple(
            listener
            for listener, is_near in zip(present, row, strict=True)
            if is_near and listener != station
        )
        for station, row in zip(ids, (distance_m <= range_m).tolist(), strict=True)
    }
