"""Messages that were true once, of somebody: replayed under one's own name or theirs."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from advpipe.pipeline.labels.claims import ALL_CLAIMS, Claim
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.bounds import checked_choice, checked_number, checked_range
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import field_of, with_fields
from advpipe.stages.attack.v2x.overheard_messages import (
    RECEPTION_RANGE_M,
    OverheardMessages,
    is_time_untrue,
    with_later_time,
)

IDENTITIES = ("own", "theirs")


class _Replay(V2xAttack):
    """Says, instead of what is true of the attacker, what another message said.

    identity: whose station id it bears. restamp: with the generation time of the message that it replaces;
    otherwise its own stays, and maps take it for as old as it is. ahead_s: generated so much later than that;
    up to the expiry of a map that keeps the newest CAM, it shuts out what really comes after it.
    """

    def __init__(
        self,
        context: AttackContext,
        *,
        identity: str,
        range_m: float,
        memory_s: float,
        restamp: bool,
        ahead_s: float,
    ) -> None:
        super().__init__(context)
        self._identity = checked_choice(context.name, "identity", identity, IDENTITIES)
        self._restamp = bool(restamp)
        self._ahead_ns = round(checked_number(context.name, "ahead_s", ahead_s, 0, 32) * 1e9)
        range_m = checked_number(context.name, "range_m", range_m, 0)
        self._overheard = OverheardMessages(context.attackers, range_m, memory_s)
        self._rngs: dict[int, np.random.Generator] = {}

    @classmethod
    def untrue(cls, parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
        return tuple(
            claim
            for claim in super().untrue(parameters)
            if claim != "generation time" or is_time_untrue(parameters)
        )

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        """Replays what was heard in the steps before this one."""
        in_order = sorted(sent, key=lambda one: (one.request_ns, one.number))
        edited = [self._echo(one) if self.context.acts(one) else one for one in in_order]
        self._overheard.listen(step, sent)
        return edited

    def _echo(self, one: Sent) -> Sent:
        other = self._choose(one, self._rng(one.station_id))
        cams = self.context.cams
        own = cams.open(one.payload)
        tree = None if other is None else cams.open(other.payload)
        if own is None or tree is None:
            return one
        if self._identity == "own":
            tree = with_fields(tree, station_id=field_of(own, "station_id"))
        if self._restamp:
            tree = with_fields(tree, generation_delta_time_ms=field_of(own, "generation_delta_time_ms"))
        return replace(one, payload=cams.close(with_later_time(tree, self._ahead_ns)))

    @abstractmethod
    def _choose(self, one: Sent, rng: np.random.Generator) -> Sent | None:
        """The message that is replayed in place of `one`."""

    def _rng(self, attacker: int) -> np.random.Generator:
        if attacker not in self._rngs:
            self._rngs[attacker] = self.context.rng("replay", attacker)
        return self._rngs[attacker]


class CamReplay(_Replay):
    """Follows another station for some messages, then the next one: F2MD's and NextGen's data replay.

    age_s: it says what the other said so long ago. messages_min, messages_max: followed in a row, drawn for
    each; then a new one is drawn among those within range_m. See `_Replay` for the others.
    """

    traits = V2xTraits(
        untrue=ALL_CLAIMS, published=Published(veremi_extension=11, nextgen=15, catch_f1=0.273)
    )

    def __init__(
        self,
        context: AttackContext,
        *,
        age_s: float = 2.0,
        messages_min: int = 4,
        messages_max: int = 8,
        range_m: float = RECEPTION_RANGE_M,
        identity: str = "own",
        restamp: bool = True,
        ahead_s: float = 0.0,
    ) -> None:
        age_s = checked_number(context.name, "age_s", age_s, 0, 600)
        # A station that sends but once a second has sent within this memory.
        super().__init__(
            context,
            identity=identity,
            range_m=range_m,
            memory_s=age_s + 2.0,
            restamp=restamp,
            ahead_s=ahead_s,
        )
        self._age_ns = round(age_s * 1e9)
        limits = checked_range(context.name, "messages_{}", messages_min, messages_max, 1, 10_000)
        self._least, self._most = int(limits[0]), int(limits[1])
        self._followed: dict[int, tuple[int, int]] = {}

    def _choose(self, one: Sent, rng: np.random.Generator) -> Sent | None:
        before_ns = one.request_ns - self._age_ns
        station, left = self._followed.get(one.station_id, (0, 0))
        found = self._overheard.last(one.station_id, station, before_ns) if left else None
        if found is None:
            stations = self._overheard.stations(one.station_id, before_ns)
            if not stations:
                return None
            station = stations[int(rng.integers(len(stations)))]
            left = int(rng.integers(self._least, self._most + 1))
            found = self._overheard.last(one.station_id, station, before_ns)
        self._followed[one.station_id] = station, left - 1
        return found


class DisruptiveReplay(_Replay):
    """Any message of any station heard in the last memory_s, drawn anew for each: F2MD's disruptive."""

    traits = V2xTraits(untrue=ALL_CLAIMS, published=Published(veremi_extension=10))

    def __init__(
        self,
        context: AttackContext,
        *,
        memory_s: float = 10.0,
        range_m: float = RECEPTION_RANGE_M,
        identity: str = "own",
        restamp: bool = True,
        ahead_s: float = 0.0,
    ) -> None:
        super().__init__(
            context,
            identity=identity,
            range_m=range_m,
            memory_s=checked_number(context.name, "memory_s", memory_s, 0, 600),
            restamp=restamp,
            ahead_s=ahead_s,
        )

    def _choose(self, one: Sent, rng: np.random.Generator) -> Sent | None:
        return self._overheard.any_of(one.station_id, rng)
