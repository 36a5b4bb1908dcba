"""Sybil attacks: one radio pretends to be many vehicles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.labels.message_quantities import MESSAGES_ADDED
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.generation import CHECK_INTERVAL_NS
from advpipe.stages.attack.bounds import checked_choice, checked_integer, checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import with_fields
from advpipe.stages.attack.v2x.ghost_motion import BrakingMotion, GhostMotion, OffsetMotion
from advpipe.stages.attack.v2x.ghost_vehicles import GhostAttack, Key
from advpipe.stages.attack.v2x.ghosts_ahead import GhostsAhead
from advpipe.stages.attack.v2x.overheard_messages import RECEPTION_RANGE_M, OverheardMessages, with_later_time

AROUND = ("attacker", "victim")
MAX_GHOSTS = 1000


class SybilGrid(GhostAttack):
    """Ghost vehicles on a grid that moves with a vehicle, 5 m apart, lanes 2 m apart.

    around: each "attacker", or the "victim", whose cells the attackers take in turns, so that no two ghost
    vehicles share a cell. Cells nearest to the vehicle come first, ahead before behind, left before right.
    ghosts: per attacker. jitter_m: the largest random offset from the cell along each axis.
    """

    traits = V2xTraits(
        every_message_matters=True, needs_traffic=False, published=Published(veremi_extension=16)
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        ghosts: int = 5,
        spacing_m: float = 5.0,
        lane_m: float = 2.0,
        lanes: int = 3,
        jitter_m: float = 0.0,
        around: str = "attacker",
        **others: Any,
    ) -> None:
        super().__init__(context, **others)
        name = context.name
        self._around_victim = checked_choice(name, "around", around, AROUND) == "victim"
        if self._around_victim and context.victim is None:
            raise UsageError(f"{name}: around is 'victim', but no victim is given; name one")
        self._jitter_m = checked_number(name, "jitter_m", jitter_m, 0)
        grids = len(context.attackers) if self._around_victim else 1
        cells = grid_cells(
            checked_integer(name, "ghosts", ghosts, 1, MAX_GHOSTS) * grids,
            checked_number(name, "spacing_m", spacing_m, 0),
            checked_number(name, "lane_m", lane_m, 0),
            checked_integer(name, "lanes", lanes, 1, 99),
        )
        self._cells = {
            attacker: cells[index % grids :: grids] for index, attacker in enumerate(context.attackers)
        }
        self._companions: dict[int, list[OffsetMotion]] = {}

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        """Each ghost vehicle sends at most one message per check."""
        return {MESSAGES_ADDED.name: (0, parameters["ghosts"] * (NS_PER_S // CHECK_INTERVAL_NS))}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        edited = list(sent)
        for attacker in self.context.attackers:
            centre = self.context.victim if self._around_victim else attacker
            assert centre is not None
            radio = self.context.radio(step, centre)
            if radio is None or self.context.radio(step, attacker) is None:
                self._companions.pop(attacker, None)
                continue
            if attacker not in self._companions:
                self._companions[attacker] = self._create_companions(attacker)
            companions = self._companions[attacker]
            motions: dict[Key, GhostMotion] = {
                (attacker, index): companion.motion(step, radio) for index, companion in enumerate(companions)
            }
            if self.context.active(step.begin_ns):
                edited += self._ghost_vehicles.messages(step, attacker, motions)
        self._ghost_vehicles.observe(step, edited)
        return edited

    def _create_companions(self, attacker: int) -> list[OffsetMotion]:
        rng, cells = self.context.rng("grid", attacker), self._cells[attacker]
        jitters_m = rng.uniform(-self._jitter_m, self._jitter_m, (len(cells), 2)).tolist()
        return [
            OffsetMotion((ahead_m + jitter_m[0], left_m + jitter_m[1]))
            for (ahead_m, left_m), jitter_m in zip(cells, jitters_m, strict=True)
        ]


def grid_cells(ghosts: int, spacing_m: float, lane_m: float, lanes: int) -> list[tuple[float, float]]:
    """The cells of ghost vehicles, in metres ahead and to the left, nearest first, without the centre."""
    sides = range(-(lanes // 2), lanes - lanes // 2)
    rows = range(-ghosts, ghosts + 1)
    cells = [(row * spacing_m, side * lane_m) for row in rows for side in sides if (row, side) != (0, 0)]
    cells.sort(key=lambda cell: (math.hypot(*cell), -cell[0], -cell[1]))
    return cells[:ghosts]


class CrawlingGhosts(GhostsAhead):
    """Ghost vehicles that brake from the target's speed and then crawl.

    jitter_m: the largest random offset of each along the road. speed_spread: the largest random deviation
    from jam_mps, as a fraction.
    """

    def __init__(
        self,
        context: AttackContext,
        *,
        jam_mps: float = 1.5,
        deceleration_mps2: float = 3.0,
        jitter_m: float = 1.0,
        speed_spread: float = 0.05,
        from_speed_mps: float = 0.0,
        **others: Any,
    ) -> None:
        super().__init__(context, from_speed_mps=from_speed_mps, **others)
        name = context.name
        self._jam_mps = checked_number(name, "jam_mps", jam_mps, 0)
        self._deceleration_mps2 = checked_number(name, "deceleration_mps2", deceleration_mps2, 0.1)
        self._jitter_m = checked_number(name, "jitter_m", jitter_m, 0)
        self._speed_spread = checked_number(name, "speed_spread", speed_spread, 0, 1)

    def _crawling(
        self,
        begin_ns: int,
        front: Float64,
        speed_mps: float,
        place_m: tuple[float, float],
        rng: np.random.Generator,
    ) -> BrakingMotion:
        """The ghost vehicle at a place ahead of a front and to its left."""
        jitter_m, spread = rng.uniform(-1, 1, 2).tolist()
        ahead_m = place_m[0] + jitter_m * self._jitter_m
        final_mps = self._jam_mps * (1 + spread * self._speed_spread)
        start = self._ghost_pose(front, ahead_m, place_m[1])
        return BrakingMotion(
            start, begin_ns, max(speed_mps, final_mps), 0.0, self._deceleration_mps2, final_mps
        )


class SybilCongestion(CrawlingGhosts):
    """A traffic jam ahead of the target: rows of crawling ghost vehicles.

    The rears of the first row are `margin_m + headway_s * speed` ahead; rows are spacing_m apart and lanes
    lane_m, with the target's lane in the middle.
    """

    traits = V2xTraits(
        every_message_matters=True,
        needs_traffic=False,
        published=Published(nextgen=13, catch_f1=0.259),
        published_of={"preset": "nextgen"},
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        ghosts: int = 6,
        lanes: int = 3,
        lane_m: float = 3.2,
        spacing_m: float = 7.5,
        margin_m: float = 5.0,
        headway_s: float = 2.0,
        **others: Any,
    ) -> None:
        super().__init__(context, **others)
        name = context.name
        self._ghost_count = checked_integer(name, "ghosts", ghosts, 1, MAX_GHOSTS)
        self._lanes = checked_integer(name, "lanes", lanes, 1, 99)
        self._lane_m = checked_number(name, "lane_m", lane_m, 0)
        self._spacing_m = checked_number(name, "spacing_m", spacing_m, 0)
        self._margin_m = checked_number(name, "margin_m", margin_m, 0)
        self._headway_s = checked_number(name, "headway_s", headway_s, 0)

    def _create(self, begin_ns: int, front: Float64, speed_mps: float, key: Key) -> list[BrakingMotion]:
        rng = self.context.rng("congestion", *key)
        gap_m = self._margin_m + self._headway_s * speed_mps
        ghosts = []
        for index in range(self._ghost_count):
            row, side = divmod(index, self._lanes)
            # The target's own lane first, then left, right, and so on.
            lane = (side + 1) // 2 * (1 if side % 2 else -1)
            place_m = gap_m + row * self._spacing_m, lane * self._lane_m
            ghosts.append(self._crawling(begin_ns, front, speed_mps, place_m, rng))
        return ghosts


_SILENCE_NS = 2_000_000_000


@dataclass
class _Track:
    """A ghost vehicle that follows a station: its id, the followed id, how much later it sends what, and when
    the last replayed message was sent."""

    id: int
    station: int
    shift_ns: int
    last_ns: int


class SybilReplay(V2xAttack):
    """Ghost vehicles on the tracks of other stations, besides the attacker's own CAMs.

    Each replays, under its own station id, all CAMs that one station sent `age_s` ago, and as much earlier as
    its own phase of the check interval, so that it sends neither when honest stations nor when other ghost
    vehicles do; generation times are shifted by the same. F2MD's replay Sybil, but there the pseudonym
    changes with each followed station. ghosts: at the same time, per attacker. range_m: within which others
    are overheard. When a station has nothing to replay for two seconds, a ghost vehicle of another station
    replaces its own.
    """

    traits = V2xTraits(
        every_message_matters=True, needs_traffic=False, published=Published(veremi_extension=17)
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        ghosts: int = 5,
        age_s: float = 3.0,
        range_m: float = RECEPTION_RANGE_M,
        ahead_s: float = 0.0,
    ) -> None:
        super().__init__(context)
        name = context.name
        self._ghosts = checked_integer(name, "ghosts", ghosts, 1, MAX_GHOSTS)
        self._age_ns = round(checked_number(name, "age_s", age_s, 0.2, 600) * 1e9)
        self._ahead_ns = round(checked_number(name, "ahead_s", ahead_s, 0, 32) * 1e9)
        self._overheard = OverheardMessages(
            context.attackers, checked_number(name, "range_m", range_m, 0), age_s + 2 * _SILENCE_NS / 1e9
        )
        self._tracks: dict[int, list[_Track]] = {attacker: [] for attacker in context.attackers}
        self._rngs = {attacker: context.rng("tracks", attacker) for attacker in context.attackers}
        self._track_count = 0

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        edited = list(sent)
        if step.end_ns is not None:
            for attacker in self.context.attackers:
                if self.context.radio(step, attacker) is not None:
                    edited += self._replay(step.begin_ns, step.end_ns, attacker)
        self._overheard.listen(step, sent)
        return edited

    def _replay(self, begin_ns: int, end_ns: int, attacker: int) -> list[Sent]:
        cams, tracks = self.context.cams, self._tracks[attacker]
        tracks[:] = [track for track in tracks if begin_ns - track.shift_ns - track.last_ns < _SILENCE_NS]
        if self.context.active(begin_ns):
            self._add_tracks(begin_ns, end_ns, attacker)
        replayed: list[Sent] = []
        for track in tracks:
            for old in self._overheard.between(
                attacker, track.station, begin_ns - track.shift_ns, end_ns - track.shift_ns
            ):
                track.last_ns = old.request_ns
                at_ns = old.request_ns + track.shift_ns
                tree = cams.open(old.payload)
                if tree is not None and self.context.active(at_ns):
                    tree = with_later_time(
                        with_fields(tree, station_id=track.id), track.shift_ns + self._ahead_ns
                    )
                    replayed.append(self.context.message(attacker, at_ns, cams.close(tree)))
        return replayed

    def _add_tracks(self, begin_ns: int, end_ns: int, attacker: int) -> None:
        """Fill up the tracks with stations to replay from this step on."""
        tracks, rng = self._tracks[attacker], self._rngs[attacker]
        missing = self._ghosts - len(tracks)
        if missing <= 0:
            return
        from_ns, until_ns = begin_ns - self._age_ns, end_ns - self._age_ns
        taken = {track.station for track in tracks}
        others = [
            station
            for station in self._overheard.stations(attacker, until_ns)
            if station not in taken and self._overheard.between(attacker, station, from_ns, until_ns)
        ]
        for index in rng.permutation(len(others))[:missing].tolist():
            self._track_count += 1
            pseudonym = self.context.pseudonym("track", attacker, self._track_count)
            shift_ns = self._age_ns + int(rng.integers(1, CHECK_INTERVAL_NS))
            tracks.append(_Track(pseudonym, others[index], shift_ns, begin_ns - shift_ns))
