"""Ghosts that are aimed at one vehicle: they stand, or brake, where it would just fail to stop."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.phantoms import Braking, GhostMotion, Key, PhantomAttack

NEAR_M = 300.0
"""Ghosts farther than that from their target no longer frighten it."""


@dataclass
class _Laid:
    """Ghosts laid out together, for the `count`-th time. senders: station ids, by place in `ghosts`."""

    count: int
    ghosts: list[Braking]
    senders: dict[int, int] = field(default_factory=dict)


class GhostsAhead(PhantomAttack):
    """Ghosts on the straight line ahead of a target: the victim, or without one each attacker's own way.

    They are laid out when the attack acts first and the target drives at least `from_speed_mps`; once the
    target has passed them all, or is `NEAR_M` away, others with new station ids follow. Several attackers
    share the ghosts of one victim: those within `NEAR_M` of it, the nearest first; what one had that leaves
    the road goes to the nearest.
    """

    def __init__(self, context: AttackContext, *, from_speed_mps: float = 3.0, **others: Any) -> None:
        super().__init__(context, **others)
        self._from_mps = checked_number(context.name, "from_speed_mps", from_speed_mps, 0)
        self._laid: dict[int, _Laid] = {}

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        context, edited = self.context, list(sent)
        radios = [context.radio(step, attacker) for attacker in context.attackers]
        present = [radio for radio in radios if radio is not None]
        if context.victim is None:
            targets = [(radio, [radio]) for radio in present]
        else:
            victim = context.radio(step, context.victim)
            targets = [] if victim is None or not present else [(victim, _nearest_first(present, victim))]
        for target, senders in targets:
            laid = self._renewed(step, target)
            motions: dict[int, dict[Key, GhostMotion]] = {}
            for index, ghost in enumerate(laid.ghosts):
                if laid.senders.get(index) not in {radio.station_id for radio in senders}:
                    near = [radio for radio in senders if _distance_m(radio, target) <= NEAR_M]
                    heir = senders[0] if index in laid.senders or not near else near[index % len(near)]
                    laid.senders[index] = heir.station_id
                key = target.station_id, laid.count, index
                motions.setdefault(laid.senders[index], {})[key] = ghost.motion(step.begin_ns)
            for sender, moving in motions.items():
                edited += self._phantoms.tell(step, sender, moving)
        self._phantoms.hear(step, edited)
        return edited

    @abstractmethod
    def _lay(self, begin_ns: int, front: Float64, speed_mps: float, key: Key) -> list[Braking]:
        """Ghosts for a target with this pose (4, 4) of its front, and this speed. key: for chance."""

    def _renewed(self, step: V2xStep, target: RadioPlace) -> _Laid:
        """The target's ghosts, laid out anew where there are none ahead any more."""
        laid = self._laid.setdefault(target.station_id, _Laid(0, []))
        front = target.map_SE3_base.copy()
        front[:3, 3] = transform_points(front, [target.size_m[0] / 2, 0.0, 0.0])
        offsets_m = [ghost.motion(step.begin_ns).map_SE3_base[:3, 3] - front[:3, 3] for ghost in laid.ghosts]
        if any(offset @ front[:3, 0] > 0 and np.linalg.norm(offset) < NEAR_M for offset in offsets_m):
            return laid
        speed_mps = float(front[:3, 0] @ target.velocity_mps)
        laid = _Laid(laid.count, [])
        if speed_mps >= self._from_mps and self.context.active(step.begin_ns):
            key = target.station_id, laid.count + 1
            laid = _Laid(laid.count + 1, self._lay(step.begin_ns, front, max(speed_mps, 0.0), key))
        self._laid[target.station_id] = laid
        return laid

    def _beside(self, front: Float64, ahead_m: float, left_m: float) -> Float64:
        """The pose of a ghost whose rear is so far ahead of a front."""
        pose = front.copy()
        pose[:3, 3] = transform_points(front, [ahead_m + self._phantoms.length_m / 2, left_m, 0.0])
        return pose


class GhostStop(GhostsAhead):
    """A vehicle that stands, all of a sudden, at the target's safety distance.

    That is the way of a reaction time and of braking, and a margin: margin_m + speed * reaction_s +
    speed^2 / (2 deceleration_mps2).
    """

    traits = V2xTraits(every_message_matters=True, needs_traffic=False)

    def __init__(
        self,
        context: AttackContext,
        *,
        margin_m: float = 2.0,
        reaction_s: float = 1.0,
        deceleration_mps2: float = 6.0,
        **others: Any,
    ) -> None:
        super().__init__(context, **others)
        self._margin_m = checked_number(context.name, "margin_m", margin_m, 0)
        self._reaction_s = checked_number(context.name, "reaction_s", reaction_s, 0)
        self._deceleration_mps2 = checked_number(context.name, "deceleration_mps2", deceleration_mps2, 0.1)

    def _lay(self, begin_ns: int, front: Float64, speed_mps: float, key: Key) -> list[Braking]:
        gap_m = self._margin_m + speed_mps * self._reaction_s + speed_mps**2 / (2 * self._deceleration_mps2)
        return [Braking(self._beside(front, gap_m, 0.0), begin_ns, 0.0, 0.0, 1.0, 0.0)]


class GhostBrake(GhostsAhead):
    """A vehicle that drives ahead of the target at its speed, and then brakes hard until it stands.

    headway_s: times the speed, its distance from the target's front. cruise_s: after which it brakes.
    """

    traits = V2xTraits(every_message_matters=True, needs_traffic=False)

    def __init__(
        self,
        context: AttackContext,
        *,
        headway_s: float = 1.0,
        cruise_s: float = 2.0,
        deceleration_mps2: float = 8.0,
        **others: Any,
    ) -> None:
        super().__init__(context, **others)
        self._headway_s = checked_number(context.name, "headway_s", headway_s, 0)
        self._cruise_s = checked_number(context.name, "cruise_s", cruise_s, 0)
        self._deceleration_mps2 = checked_number(context.name, "deceleration_mps2", deceleration_mps2, 0.1)

    def _lay(self, begin_ns: int, front: Float64, speed_mps: float, key: Key) -> list[Braking]:
        start = self._beside(front, self._headway_s * speed_mps, 0.0)
        return [Braking(start, begin_ns, speed_mps, self._cruise_s, self._deceleration_mps2, 0.0)]


def _distance_m(one: RadioPlace, other: RadioPlace) -> float:
    return math.dist(one.map_SE3_base[:3, 3], other.map_SE3_base[:3, 3])


def _nearest_first(radios: Sequence[RadioPlace], target: RadioPlace) -> list[RadioPlace]:
    return sorted(radios, key=lambda radio: (_distance_m(radio, target), radio.station_id))
