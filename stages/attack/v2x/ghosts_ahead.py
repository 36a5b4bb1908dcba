"""Ghost vehicles ahead of one target, which stand or brake near its stopping distance."""

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
from advpipe.stages.attack.v2x.ghost_motion import BrakingMotion, GhostMotion
from advpipe.stages.attack.v2x.ghost_past import PastPose, Trail
from advpipe.stages.attack.v2x.ghost_vehicles import GhostAttack, Key

MAX_DISTANCE_M = 300.0
"""Ghost vehicles farther than this from their target have no effect on it."""


@dataclass
class _GhostGroup:
    """Ghost vehicles created together, the `count`-th group. pasts: where they claim to come from. senders:
    station ids, by index in `ghosts`."""

    count: int
    ghosts: list[BrakingMotion]
    pasts: list[list[PastPose]]
    senders: dict[int, int] = field(default_factory=dict)


class GhostsAhead(GhostAttack):
    """Ghost vehicles on the straight line ahead of a target: the victim, or each attacker if there is none.

    A group is created when the attack becomes active and the target drives at least `from_speed_mps`; once
    the target has passed them all, or is `MAX_DISTANCE_M` away, a group with new station ids follows. Several
    attackers within `MAX_DISTANCE_M` share the ghost vehicles of one victim, the nearest first; the nearest
    attacker takes over those of an attacker that leaves the road. In their path histories they have come the
    target's way, ahead of it.
    """

    def __init__(self, context: AttackContext, *, from_speed_mps: float = 3.0, **others: Any) -> None:
        super().__init__(context, **others)
        self._from_mps = checked_number(context.name, "from_speed_mps", from_speed_mps, 0)
        self._groups: dict[int, _GhostGroup] = {}
        self._trails: dict[int, Trail] = {}

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
            group = self._group(step, target)
            motions: dict[int, dict[Key, GhostMotion]] = {}
            pasts: dict[Key, list[PastPose]] = {}
            for index, (ghost, past) in enumerate(zip(group.ghosts, group.pasts, strict=True)):
                if group.senders.get(index) not in {radio.station_id for radio in senders}:
                    near = [radio for radio in senders if _distance_m(radio, target) <= MAX_DISTANCE_M]
                    successor = senders[0] if index in group.senders or not near else near[index % len(near)]
                    group.senders[index] = successor.station_id
                key = target.station_id, group.count, index
                motions.setdefault(group.senders[index], {})[key] = ghost.motion(step.begin_ns)
                pasts[key] = past
            for sender, moving in motions.items():
                edited += self._ghost_vehicles.messages(step, sender, moving, pasts)
        self._ghost_vehicles.observe(step, edited)
        return edited

    @abstractmethod
    def _create(self, begin_ns: int, front: Float64, speed_mps: float, key: Key) -> list[BrakingMotion]:
        """Ghost vehicles for a target with this pose (4, 4) of its front, and this speed. key: of random
        draws."""

    def _group(self, step: V2xStep, target: RadioPlace) -> _GhostGroup:
        """The target's ghost vehicles; a new group if none is ahead of it any more."""
        group = self._groups.setdefault(target.station_id, _GhostGroup(0, [], []))
        trail = self._trails.setdefault(target.station_id, Trail())
        trail.add(step.begin_ns, target.map_SE3_base)
        front = target.map_SE3_base.copy()
        front[:3, 3] = transform_points(front, [target.size_m[0] / 2, 0.0, 0.0])
        offsets_m = [ghost.motion(step.begin_ns).map_SE3_base[:3, 3] - front[:3, 3] for ghost in group.ghosts]
        if any(offset @ front[:3, 0] > 0 and np.linalg.norm(offset) < MAX_DISTANCE_M for offset in offsets_m):
            return group
        speed_mps = float(front[:3, 0] @ target.velocity_mps)
        group = _GhostGroup(group.count, [], [])
        if speed_mps >= self._from_mps and self.context.active(step.begin_ns):
            key = target.station_id, group.count + 1
            ghosts = self._create(step.begin_ns, front, max(speed_mps, 0.0), key)
            pasts = [trail.before(ghost, step.begin_ns, front) for ghost in ghosts]
            group = _GhostGroup(group.count + 1, ghosts, pasts)
        self._groups[target.station_id] = group
        return group

    def _ghost_pose(self, front: Float64, ahead_m: float, left_m: float) -> Float64:
        """The pose of a ghost vehicle with its rear this far ahead of a front."""
        pose = front.copy()
        pose[:3, 3] = transform_points(front, [ahead_m + self._ghost_vehicles.length_m / 2, left_m, 0.0])
        return pose


class GhostStop(GhostsAhead):
    """A stationary ghost vehicle that suddenly appears at the target's safety distance.

    The distance is margin_m + speed * reaction_s + speed^2 / (2 deceleration_mps2): a margin, the reaction
    distance and the braking distance; its path history says that it has just braked to a standstill there.
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

    def _create(self, begin_ns: int, front: Float64, speed_mps: float, key: Key) -> list[BrakingMotion]:
        gap_m = self._margin_m + speed_mps * self._reaction_s + speed_mps**2 / (2 * self._deceleration_mps2)
        stop_ns = math.ceil(speed_mps / self._deceleration_mps2 * 1e9)
        start = self._ghost_pose(front, gap_m - speed_mps**2 / (2 * self._deceleration_mps2), 0.0)
        return [BrakingMotion(start, begin_ns - stop_ns, speed_mps, 0.0, self._deceleration_mps2, 0.0)]


class GhostBrake(GhostsAhead):
    """A ghost vehicle that drives ahead of the target at its speed, and then brakes hard to a standstill.

    headway_s: the distance from the target's front, divided by the speed. cruise_s: time until it brakes.
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

    def _create(self, begin_ns: int, front: Float64, speed_mps: float, key: Key) -> list[BrakingMotion]:
        start = self._ghost_pose(front, self._headway_s * speed_mps, 0.0)
        return [BrakingMotion(start, begin_ns, speed_mps, self._cruise_s, self._deceleration_mps2, 0.0)]


def _distance_m(one: RadioPlace, other: RadioPlace) -> float:
    return math.dist(one.map_SE3_base[:3, 3], other.map_SE3_base[:3, 3])


def _nearest_first(radios: Sequence[RadioPlace], target: RadioPlace) -> list[RadioPlace]:
    return sorted(radios, key=lambda radio: (_distance_m(radio, target), radio.station_id))
