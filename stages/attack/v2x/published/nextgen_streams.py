"""NextGen's attacks on the message stream: denial of service, congestion and replay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from advpipe.pipeline.labels.claims import ALL_CLAIMS
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.bounds import checked_integer
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import field_of, position_deg, with_fields
from advpipe.stages.attack.v2x.flood import degrees_per_metre
from advpipe.stages.attack.v2x.overheard_messages import OverheardMessages, with_later_time
from advpipe.stages.attack.v2x.published.own_rate import OwnRateFlood, as_own

COPIES = 2, 3, 4
WINDOW_NS = 500_000_000
"""The time over which copies are spread: the least interval of CAMs there."""
FIRST_COPY = 2_000_000
"""The number of the first additional message, by which the code also multiplies the spacing."""
REPLAYED_NS, REPLAYED_M, FARTHEST_M = 5_000_000_000, 400.0, 1000.0


class NextgenDos(OwnRateFlood):
    """Two to four identical copies of each message, by attacker, the first one included: in equal intervals
    of half a second."""

    traits = V2xTraits(every_message_matters=True, published=Published(nextgen=12, catch_f1=0.353))
    keeps_due = True

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context, COPIES)

    def spacing_ns(self, attacker: int, interval_ns: int) -> int:
        return round(WINDOW_NS / self.multiples[attacker])

    def content(self, step: V2xStep, own: Sent, at_ns: int, place: int) -> CamTree | None:
        tree = self.context.cams.open(own.payload)
        return None if tree is None else with_later_time(tree, at_ns - own.request_ns)


class NextgenCongestion(V2xAttack):
    """Four to six ghost vehicles around the attacker for each of its messages, by attacker, each with a new
    id.

    2 to 3 m to a side and 5 to 6 m a row ahead or behind, with up to 2 m of error along both axes, 5 % of
    speed and of acceleration, and 1 % of heading. The code takes headings, which count from north, as if they
    counted from the x axis, and so places them. It also sends the i-th one the attacker's spacing, 1 to 100
    µs, times first_copy + i later, which is 2 to 200 s. first_copy: 0 for what its documentation describes.
    """

    traits = V2xTraits(every_message_matters=True, published=Published(nextgen=13, catch_f1=0.259))

    def __init__(self, context: AttackContext, *, first_copy: int = FIRST_COPY) -> None:
        super().__init__(context)
        self._first_copy = checked_integer(context.name, "first_copy", first_copy, 0, FIRST_COPY)
        self._rngs = {attacker: context.rng("congestion", attacker) for attacker in context.attackers}
        self._spacings_ns = {one: int(rng.integers(1000, 100_001)) for one, rng in self._rngs.items()}
        self._amounts = {one: int(rng.integers(4, 7)) for one, rng in self._rngs.items()}
        self._due: list[tuple[int, Sent, int]] = []
        self._ghosts = 0

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        for message in sorted(sent, key=lambda one: (one.request_ns, one.number)):
            if self.context.acts(message):
                spacing_ns = self._spacings_ns[message.station_id]
                self._due += [
                    (message.request_ns + spacing_ns * (self._first_copy + index), message, index)
                    for index in range(self._amounts[message.station_id])
                ]
        if step.end_ns is None:
            return sent
        present = {radio.station_id for radio in step.radios}
        ready = [one for one in self._due if one[0] < step.end_ns]
        self._due = [one for one in self._due if one[0] >= step.end_ns]
        ghosts = [self._ghost(*one) for one in ready if one[1].station_id in present]
        return [*sent, *(ghost for ghost in ghosts if ghost is not None)]

    def _ghost(self, at_ns: int, own: Sent, index: int) -> Sent | None:
        tree = self.context.cams.open(own.payload)
        if tree is None:
            return None
        names = ("latitude_deg", "longitude_deg", "heading_rad", "speed_mps")
        values: list[float] = [
            math.nan if (found := field_of(tree, name)) is None else found for name in names
        ]
        if not np.isfinite(values).all():
            return None
        latitude_deg, longitude_deg, heading_rad, speed_mps = values
        rng = self._rngs[own.station_id]
        side_m, row_m = _signed(rng, 2, 3), _signed(rng, 5, 6) * math.ceil(index / 2)
        cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
        x_m = cosine * row_m - sine * side_m + rng.uniform(-2, 2)
        y_m = sine * row_m + cosine * side_m + rng.uniform(-2, 2)
        per_x_deg, per_y_deg = degrees_per_metre(latitude_deg, longitude_deg)
        acceleration_mps2 = field_of(tree, "longitudinal_acceleration_mps2")
        self._ghosts += 1
        fields = {
            "station_id": self.context.pseudonym("ghost", own.station_id, self._ghosts),
            "latitude_deg": latitude_deg + float(y_m) * per_y_deg,
            "longitude_deg": longitude_deg + float(x_m) * per_x_deg,
            "speed_mps": speed_mps * (1 + float(rng.uniform(-0.05, 0.05))),
            "heading_rad": heading_rad * (1 + float(rng.uniform(-0.01, 0.01))) % math.tau,
        }
        varied = 1 + float(rng.uniform(-0.05, 0.05))
        if acceleration_mps2 is not None:
            fields["longitudinal_acceleration_mps2"] = acceleration_mps2 * varied
        tree = with_later_time(with_fields(tree, **fields), at_ns - own.request_ns)
        return self.context.message(own.station_id, at_ns, self.context.cams.close(tree), own.power_dbm)


class NextgenReplay(V2xAttack):
    """A victim's messages under the own id, from the oldest of the last five seconds on: one, and four to
    eight more by attacker.

    Of messages within 400 m of the attacker, whoever received them; the next victim, another one, is that of
    a random message. Without a victim, the own message stays.
    """

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim not in ("station id", "generation time")),
        every_message_matters=True,
        published=Published(nextgen=15, catch_f1=0.273),
    )

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self._overheard = OverheardMessages(context.attackers, FARTHEST_M, REPLAYED_NS / NS_PER_S)
        self._rngs = {attacker: context.rng("replay", attacker) for attacker in context.attackers}
        self._lengths = {one: int(rng.integers(4, 9)) for one, rng in self._rngs.items()}
        self._counts = dict.fromkeys(context.attackers, 0)
        self._last: dict[int, Sent] = {}
        self._places_m: dict[int, tuple[int, tuple[float, float]]] = {}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        in_order = sorted(sent, key=lambda message: (message.request_ns, message.number))
        edited = [self._replayed(one) if self.context.acts(one) else one for one in in_order]
        self._overheard.listen(step, sent)
        horizon_ns = step.begin_ns - REPLAYED_NS
        self._places_m = {number: place for number, place in self._places_m.items() if place[0] >= horizon_ns}
        return edited

    def _replayed(self, message: Sent) -> Sent:
        cams, found = self.context.cams, self._choose(message)
        own, tree = cams.open(message.payload), None if found is None else cams.open(found.payload)
        if own is None or tree is None or found is None:
            return message
        self._last[message.station_id] = found
        return replace(message, payload=cams.close(as_own(tree, own, 0)))

    def _choose(self, message: Sent) -> Sent | None:
        attacker, stations = (
            message.station_id,
            self._overheard.stations(message.station_id, message.request_ns),
        )
        last = self._last.get(attacker)
        if last is not None and self._counts[attacker] < self._lengths[attacker]:
            again = self._near(message, [last.station_id])
            found = next((one for one in again if one.request_ns > last.request_ns), None)
            if found is not None:
                self._counts[attacker] += 1
                return found
        others = self._near(message, [one for one in stations if last is None or one != last.station_id])
        if not others:
            return None
        self._counts[attacker] = 0
        victim = others[int(self._rngs[attacker].integers(len(others)))].station_id
        return next(one for one in others if one.station_id == victim)

    def _near(self, message: Sent, stations: Sequence[int]) -> list[Sent]:
        """The messages of these stations to choose from, in order of time."""
        now_ns, own_m = message.request_ns, self._place_m(message)
        found = [
            one
            for station in stations
            for one in self._overheard.between(message.station_id, station, now_ns - REPLAYED_NS, now_ns)
            if math.dist(self._place_m(one), own_m) < REPLAYED_M
        ]
        return sorted(found, key=lambda one: (one.request_ns, one.number))

    def _place_m(self, message: Sent) -> tuple[float, float]:
        """Where a message claims to be from; remembered, as each attacker looks at it many times."""
        if message.number not in self._places_m:
            self._places_m[message.number] = message.request_ns, self._claimed_m(message)
        return self._places_m[message.number][1]

    def _claimed_m(self, message: Sent) -> tuple[float, float]:
        tree = self.context.cams.open(message.payload)
        latitude_deg, longitude_deg = (None, None) if tree is None else position_deg(tree)
        if latitude_deg is None or longitude_deg is None:
            return math.inf, math.inf
        return self.context.geodesy.place_m(latitude_deg, longitude_deg)


def _signed(rng: np.random.Generator, least: float, most: float) -> float:
    size = float(rng.uniform(least, most))
    return size if rng.random() < 0.5 else -size
