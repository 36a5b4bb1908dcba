"""F2MD's table of the stations that a vehicle has heard, and the replays that follow one of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.v2x.base import AttackContext
from advpipe.stages.attack.v2x.cams import field_of
from advpipe.stages.attack.v2x.overheard_messages import RECEPTION_RANGE_M, OverheardMessages

KEPT = 20
"""Messages of each station."""
REMEMBERED_S = 3600.0
"""Its table forgets no station before 200 others have come."""
FOLLOWED_S = 1.1
"""A victim that has been silent for longer is given up."""


class DetectedNodes:
    """What each attacker has overheard, the last messages of every station."""

    def __init__(self, context: AttackContext) -> None:
        self._context = context
        self._overheard = OverheardMessages(context.attackers, RECEPTION_RANGE_M, REMEMBERED_S, KEPT)

    def listen(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """Store the messages of a step, after the step."""
        self._overheard.listen(step, sent)

    def random(self, attacker: int, now_ns: int, rng: np.random.Generator) -> Sent | None:
        """A random message of a random station; None where none was heard."""
        stations = self._overheard.stations(attacker, now_ns)
        if not stations:
            return None
        kept = self._overheard.between(attacker, stations[int(rng.integers(len(stations)))], 0, now_ns)
        return kept[int(rng.integers(len(kept)))]

    def next_of_victim(self, attacker: int, last: Sent | None, own: Sent) -> Sent | None:
        """The latest message of the station of the last one, while that is recent, or else of the station
        that claims to be nearest to the attacker's own message."""
        now_ns = own.request_ns
        if last is not None and now_ns - last.request_ns <= FOLLOWED_S * NS_PER_S:
            return self._overheard.last(attacker, last.station_id, now_ns) or last
        place_m = self.place_m(own)
        latest = [
            message
            for station in self._overheard.stations(attacker, now_ns)
            if (message := self._overheard.last(attacker, station, now_ns)) is not None
        ]
        return min(latest, key=lambda one: (math.dist(self.place_m(one), place_m), one.number), default=None)

    def place_m(self, message: Sent) -> tuple[float, float]:
        """Where in the map a message claims to be; infinitely far for one that claims no place."""
        tree = self._context.cams.open(message.payload)
        degrees = [
            None if tree is None else field_of(tree, name) for name in ("latitude_deg", "longitude_deg")
        ]
        if degrees[0] is None or degrees[1] is None:
            return 1e9, 1e9
        x_m, y_m, _ = self._context.geodesy.to_map([degrees[0], degrees[1], 0.0]).tolist()
        return x_m, y_m


class ReplayedSequence:
    """The messages that one attacker replays: some of a victim, then a random one, whose station follows.

    length: how many of one victim, at most.
    """

    def __init__(self, nodes: DetectedNodes, attacker: int, length: int, rng: np.random.Generator) -> None:
        self._nodes, self._attacker, self._rng = nodes, attacker, rng
        self._length, self._count = length, 0
        self._last: Sent | None = None

    def next(self, own: Sent) -> tuple[Sent | None, bool]:
        """The message to replay instead of one of the attacker's own, and whether it is of another station
        than the one before; None where nothing was heard."""
        if self._count < self._length:
            found = self._nodes.next_of_victim(self._attacker, self._last, own)
            self._count += found is not None
        else:
            found = self._nodes.random(self._attacker, own.request_ns, self._rng)
            self._count = 0
        if found is None:
            return None, False
        is_other = self._last is None or self._last.station_id != found.station_id
        self._last = found
        return found, is_other
