"""Replay attacks: overheard messages, sent again under the attacker's or the original station id."""

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
    with_later_time,
    without_true_time,
)

IDENTITIES = ("own", "theirs")


class _Replay(V2xAttack):
    """Replaces the attacker's messages by overheard ones.

    identity: whether they bear the attacker's "own" station id or "theirs". restamp: with the generation time
    of the message that it replaces; otherwise the old time stays and reveals the age. ahead_s: how far the
    generation time is moved into the future; LDMs that keep the newest CAM then ignore later genuine ones, up
    to their expiry.
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
        return without_true_time(super().untrue(parameters), parameters)

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        """Replays messages that were overheard in earlier steps."""
        in_order = sorted(sent, key=lambda message: (message.request_ns, message.number))
        edited = [self._replayed(message) if self.context.acts(message) else message for message in in_order]
        self._overheard.listen(step, sent)
        return edited

    def _replayed(self, message: Sent) -> Sent:
        other = self._choose(message, self._rng(message.station_id))
        cams = self.context.cams
        own = cams.open(message.payload)
        tree = None if other is None else cams.open(other.payload)
        if own is None or tree is None:
            return message
        if self._identity == "own":
            tree = with_fields(tree, station_id=field_of(own, "station_id"))
        if self._restamp:
            tree = with_fields(tree, generation_delta_time_ms=field_of(own, "generation_delta_time_ms"))
        return replace(message, payload=cams.close(with_later_time(tree, self._ahead_ns)))

    @abstractmethod
    def _choose(self, message: Sent, rng: np.random.Generator) -> Sent | None:
        """The message that is replayed in place of `one`."""

    def _rng(self, attacker: int) -> np.random.Generator:
        if attacker not in self._rngs:
            self._rngs[attacker] = self.context.rng("replay", attacker)
        return self._rngs[attacker]


class CamReplay(_Replay):
    """Replays several messages of one station, then of the next one: F2MD's and NextGen's data replay.

    age_s: the age of replayed messages. messages_min, messages_max: how many messages of one station are
    replayed, drawn for each station; the next station is drawn among those within range_m. See `_Replay` for
    the other parameters.
    """

    traits = V2xTraits(
        untrue=ALL_CLAIMS,
        published=Published(veremi_extension=11, nextgen=15, catch_f1=0.273),
        published_of={"preset": "nextgen"},
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
        # Within this time, even a station with one message a second has sent one.
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

    def _choose(self, message: Sent, rng: np.random.Generator) -> Sent | None:
        before_ns = message.request_ns - self._age_ns
        station, left = self._followed.get(message.station_id, (0, 0))
        found = self._overheard.last(message.station_id, station, before_ns) if left else None
        if found is None:
            stations = self._overheard.stations(message.station_id, before_ns)
            if not stations:
                return None
            station = stations[int(rng.integers(len(stations)))]
            left = int(rng.integers(self._least, self._most + 1))
            found = self._overheard.last(message.station_id, station, before_ns)
        self._followed[message.station_id] = station, left - 1
        return found


class DisruptiveReplay(_Replay):
    """Replays random messages of any station, overheard in the last memory_s: F2MD's disruptive replay."""

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

    def _choose(self, message: Sent, rng: np.random.Generator) -> Sent | None:
        return self._overheard.any_of(message.station_id, rng)
