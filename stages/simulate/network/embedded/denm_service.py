"""What a vehicle warns others of: standing, hard braking, a threatening collision."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.v2x.facilities.denm import EventKind
from advpipe.pipeline.v2x.facilities.denm_generation import NUMBERS, DenmGenerator
from advpipe.pipeline.v2x.facilities.own_state import STANDING_MPS
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import DenmRules
from advpipe.stages.simulate.network.embedded.hazards import Hazards
from advpipe.stages.simulate.network.embedded.service import GeneratedMessage
from advpipe.stages.simulate.traffic.road_users import RoadUser

PHASE_NS = 10_000_000
"""Stations do not send at the same time what they notice in the same step."""
HELD_NS = 500_000_000
"""An event lasts this long after the vehicle last noticed it."""


class DenmService:
    """The DEN basic service of one station and the applications that use it; a `MessageService`.

    It stands: for `stopped_s`. It brakes: at least with `braking_mps2`, when it was faster than
    `braking_from_mps`. A collision threatens: in less than `time_to_collision_s`, by the true state of the
    vehicle ahead, as its own sensors would measure it.
    """

    def __init__(self, rules: DenmRules, hazards: Hazards, seed: int, station_id: int) -> None:
        self._rules, self._hazards, self._seed = rules, hazards, seed
        phase_ns = int(self._rng("phase", station_id).integers(PHASE_NS))
        self.generator = DenmGenerator(rules, station_id, phase_ns, self._first_number(station_id))
        self._standing_since_ns: int | None = None
        self._noticed_ns: dict[EventKind, int] = {}

    @property
    def is_active(self) -> bool:
        """See `MessageService`."""
        return self.generator.is_active

    def rename(self, pseudonym: int) -> None:
        """See `MessageService`."""
        self.generator.rename(pseudonym, self._first_number(pseudonym))

    def update(
        self, now_ns: int, state: StationState, user: RoadUser, drivers: Mapping[str, RoadUser]
    ) -> None:
        """See `MessageService`."""
        self._hazards.update(now_ns, drivers)
        for kind in self._noticed(now_ns, state, user):
            self._noticed_ns[kind] = now_ns
        lasting = [kind for kind, last_ns in self._noticed_ns.items() if now_ns - last_ns <= HELD_NS]
        if self._standing_since_ns is None and EventKind.STOPPED in lasting:
            lasting.remove(EventKind.STOPPED)  # it drives again
        self.generator.update(now_ns, state, lasting)

    def messages_before(self, end_ns: int) -> Iterator[GeneratedMessage]:
        """See `MessageService`."""
        for time_ns, payload in self.generator.messages_before(end_ns):
            yield GeneratedMessage(time_ns, payload)

    def _noticed(self, now_ns: int, state: StationState, user: RoadUser) -> Iterator[EventKind]:
        if state.speed_mps >= STANDING_MPS:
            self._standing_since_ns = None
        elif self._standing_since_ns is None:
            self._standing_since_ns = now_ns
        if self._standing_since_ns is not None:
            if now_ns - self._standing_since_ns >= round(self._rules.stopped_s * 1e9):
                yield EventKind.STOPPED
            return
        braking_mps2 = -(state.longitudinal_acceleration_mps2 or 0.0)
        is_braking = EventKind.BRAKING in self._noticed_ns and (
            now_ns - self._noticed_ns[EventKind.BRAKING] <= HELD_NS
        )
        if braking_mps2 >= self._rules.braking_mps2 and (
            is_braking or state.speed_mps >= self._rules.braking_from_mps
        ):
            yield EventKind.BRAKING
        if self._hazards.time_to_collision_s(user) < self._rules.time_to_collision_s:
            yield EventKind.COLLISION

    def _first_number(self, station_id: int) -> int:
        """The sequence number with which a station id begins."""
        return int(self._rng("number", station_id).integers(NUMBERS))

    def _rng(self, use: str, station_id: int) -> np.random.Generator:
        return named_generator(self._seed, "v2x", "denm", use, station_id)
