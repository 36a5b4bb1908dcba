"""Warnings that do not reach others, or that are taken back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.facilities.denm import ActionId, Denm, decode_denm, encode_denm
from advpipe.pipeline.v2x.message_type import DENM
from advpipe.stages.attack.bounds import checked_choice, checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.overheard_messages import RECEPTION_RANGE_M

MOST_PHASE_NS = 10_000_000
"""Several attackers that answer the same DENM do not send at the same time."""
MODES = ("negate", "cancel", "drop")


class DenmSuppress(V2xAttack):
    """Ends the warnings of others, or keeps the attacker's own to itself.

    mode: "negate" says under the attacker's own station id that the event is over; "cancel" says so under
    the station id of the station that announced it; "drop" sends none of the attacker's own DENMs. An
    attacker answers DENMs that are sent within range_m of it, reaction_s and a constant of its own below
    10 ms later, and the same event again after repetition_s at the earliest.
    choice: `heard` ends the event that it has just heard of; `random` any one that it has heard of so far,
    the baseline with as many DENMs; not with "drop".
    """

    traits = V2xTraits(every_message_matters=True, needs_traffic=False, message_types=(DENM.name,))

    def __init__(
        self,
        context: AttackContext,
        *,
        mode: str = "negate",
        range_m: float = RECEPTION_RANGE_M,
        reaction_s: float = 0.02,
        repetition_s: float = 0.5,
        choice: str = "heard",
    ) -> None:
        super().__init__(context)
        self._mode = checked_choice(context.name, "mode", mode, MODES)
        self._range_m = checked_number(context.name, "range_m", range_m, 0)
        self._reaction_ns = round(checked_number(context.name, "reaction_s", reaction_s, 0.001, 60) * 1e9)
        self._repetition_ns = round(
            checked_number(context.name, "repetition_s", repetition_s, 0.01, 600) * 1e9
        )
        self._is_random = checked_choice(context.name, "choice", choice, ("heard", "random")) == "random"
        if self._is_random and mode == "drop":
            raise UsageError(f"{context.name}: choice 'random' ends other events; mode 'drop' ends none")
        self._heard: dict[int, dict[ActionId, Denm]] = {}
        self._last_ns: dict[tuple[int, ActionId], int] = {}
        self._phases_ns: dict[int, int] = {}
        self._pending: list[tuple[int, int, Denm]] = []

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        if self._mode == "drop":
            return [one for one in sent if not self.context.acts(one)]
        if step.end_ns is None:
            return sent
        self._overhear(step, sent)
        return [*sent, *self._answers(step.begin_ns, step.end_ns)]

    def _overhear(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        context = self.context
        radios = {radio.station_id: radio.map_SE3_base[:3, 3] for radio in step.radios}
        for one in sorted(sent, key=lambda each: (each.request_ns, each.number)):
            denm = _opened(one.payload)
            if one.station_id in context.attacking or denm is None or denm.termination is not None:
                continue
            for attacker in context.attackers:
                if attacker not in radios or not context.active(one.request_ns):
                    continue
                if math.dist(radios[attacker], radios[one.station_id]) > self._range_m:
                    continue
                self._heard.setdefault(attacker, {})[denm.action] = denm
                last_ns = self._last_ns.get((attacker, denm.action))
                if last_ns is None or one.request_ns - last_ns >= self._repetition_ns:
                    self._last_ns[attacker, denm.action] = one.request_ns
                    at_ns = one.request_ns + self._reaction_ns + self._phase_ns(attacker)
                    self._pending.append((at_ns, attacker, self._chosen(attacker, one, denm)))

    def _chosen(self, attacker: int, sent: Sent, heard: Denm) -> Denm:
        """The DENM whose event the attacker ends when it hears this one."""
        if not self._is_random:
            return heard
        known = list(self._heard[attacker].values())
        return known[int(self.context.rng("choice", attacker, sent.number).integers(len(known)))]

    def _phase_ns(self, attacker: int) -> int:
        if attacker not in self._phases_ns:
            self._phases_ns[attacker] = int(self.context.rng("phase", attacker).integers(MOST_PHASE_NS))
        return self._phases_ns[attacker]

    def _answers(self, begin_ns: int, end_ns: int) -> Iterator[Sent]:
        """The terminations that are due, of attackers that are still active."""
        due = [one for one in self._pending if one[0] < end_ns]
        self._pending = [one for one in self._pending if one[0] >= end_ns]
        for at_ns, attacker, denm in due:
            if at_ns < begin_ns or not self.context.active(at_ns):
                continue
            own_id = self.context.identities.of(attacker)
            by = own_id if self._mode == "negate" else denm.action.station_id
            answer = denm.terminated(by, max(at_ns, denm.reference_ns))
            yield self.context.message(attacker, at_ns, encode_denm(answer))


@lru_cache(4096)
def _opened(payload: bytes) -> Denm | None:
    """The DENM in a message; None for other bytes."""
    try:
        return decode_denm(payload)
    except MessageError:
        return None
