"""F2MD's replays: an attacker's messages are replaced by those of stations that it has heard."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace

from advpipe.pipeline.labels.claims import ALL_CLAIMS
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import field_of, with_fields
from advpipe.stages.attack.v2x.published.detected_nodes import DetectedNodes, ReplayedSequence

LENGTHS = (2, 6)
"""The code rounds the factor 1 +- 55 % down to 0 or 1 before it multiplies by 6, and takes 2 at least."""


class _F2mdReplay(V2xAttack):
    """Replaces each own message by another, as one that is sent now."""

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self.nodes = DetectedNodes(context)
        self.rngs = {attacker: context.rng("replay", attacker) for attacker in context.attackers}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        in_order = sorted(sent, key=lambda message: (message.request_ns, message.number))
        edited = [self._replayed(one) if self.context.acts(one) else one for one in in_order]
        self.nodes.listen(step, sent)
        return edited

    def _replayed(self, message: Sent) -> Sent:
        cams = self.context.cams
        own, chosen = cams.open(message.payload), self.choose(message)
        tree = None if chosen is None else cams.open(chosen[0].payload)
        if own is None or chosen is None or tree is None:
            return message
        station_id = field_of(own, "station_id") if chosen[1] is None else chosen[1]
        now_ms = field_of(own, "generation_delta_time_ms")
        tree = with_fields(tree, station_id=station_id, generation_delta_time_ms=now_ms)
        return replace(message, payload=cams.close(tree))

    @abstractmethod
    def choose(self, message: Sent) -> tuple[Sent, int | None] | None:
        """The message that replaces one, and under which station id, None for the attacker's own; None for no
        replay."""


class F2mdDisruptive(_F2mdReplay):
    """A random message of a random station, of its last 20, under the own id."""

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim not in ("station id", "generation time")),
        every_message_matters=True,
        published=Published(veremi_extension=10),
    )

    def choose(self, message: Sent) -> tuple[Sent, int | None] | None:
        attacker = message.station_id
        found = self.nodes.random(attacker, message.request_ns, self.rngs[attacker])
        return None if found is None else (found, None)


class F2mdReplay(_F2mdReplay):
    """The newest messages of a victim under the own id, two or six by attacker, and then a random one."""

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim not in ("station id", "generation time")),
        every_message_matters=True,
        published=Published(veremi_extension=11),
    )

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self.sequences = {
            attacker: ReplayedSequence(self.nodes, attacker, LENGTHS[int(rng.integers(2))], rng)
            for attacker, rng in self.rngs.items()
        }

    def choose(self, message: Sent) -> tuple[Sent, int | None] | None:
        found, _ = self.sequences[message.station_id].next(message)
        return None if found is None else (found, None)


class F2mdReplaySybil(F2mdReplay):
    """The same under a pseudonym, which changes with the replayed station."""

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim != "generation time"),
        every_message_matters=True,
        published=Published(veremi_extension=17),
    )

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self._pseudonyms: dict[int, int] = {}
        self._count = 0

    def choose(self, message: Sent) -> tuple[Sent, int | None] | None:
        attacker = message.station_id
        found, is_other = self.sequences[attacker].next(message)
        if found is None:
            return None
        if is_other:
            self._count += 1
            self._pseudonyms[attacker] = self.context.pseudonym("victim", attacker, self._count)
        return found, self._pseudonyms[attacker]
