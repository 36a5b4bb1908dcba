"""Attacks on collective perception: attackers report objects that are not there, or not those that are."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.transforms import Float64, transform_points, yaw_of
from advpipe.pipeline.labels.claims import Claim
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec import cpm_quantities as c
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.codec.cpm_codec import CPM_CODEC, OBJECTS
from advpipe.pipeline.v2x.codec.message_codec import MessageTree
from advpipe.pipeline.v2x.facilities.cpm import MAX_OBJECTS, PerceivedObject
from advpipe.pipeline.v2x.facilities.cpm_generation import OWN_SENSOR_ID
from advpipe.pipeline.v2x.facilities.cpm_tree import cpm_of_tree, object_tree
from advpipe.pipeline.v2x.facilities.heard_objects import MapFrame, map_frame
from advpipe.pipeline.v2x.message_type import CPM
from advpipe.stages.attack.bounds import checked_choice, checked_integer, checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits

PERCEIVED: Claim = "perceived objects"
NOWHERE_NEAR_M = 400.0
"""No object is reported farther than this from the station: the range of a CPM's sensors ends there."""


class OwnCpm(NamedTuple):
    """An attacker's CPM before its falsification. objects: ASN.1 values. frame: of its reference position."""

    sent: Sent
    objects: list[MessageTree]
    frame: MapFrame

    def place_m(self, values: MessageTree) -> tuple[float, float]:
        """x and y of an object in the map's frame."""
        position = values["position"]
        east_m, north_m = (position[f"{axis}Coordinate"]["value"] / c.COORDINATE.per_unit for axis in "xy")
        return self.frame.to_map(east_m, north_m)


class CpmAttack(V2xAttack):
    """Changes the list of objects in the attackers' CPMs, and leaves every other bit as it is."""

    @abstractmethod
    def falsify(self, step: V2xStep, cpm: OwnCpm) -> list[MessageTree]:
        """The objects to report instead; called for each CPM of an attacker while the attack is active."""

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        return [self._edited(step, one) if self.context.acts(one) else one for one in sent]

    def _edited(self, step: V2xStep, one: Sent) -> Sent:
        try:
            tree = CPM_CODEC.decode(one.payload)
            frame = map_frame(cpm_of_tree(tree), self.context.geodesy)
        except MessageError:
            return one
        if frame is None:
            return one
        containers = {each["containerId"]: each["containerData"] for each in tree["payload"]["cpmContainers"]}
        before = containers.get(OBJECTS, {"numberOfPerceivedObjects": 0, "perceivedObjects": []})
        listed = before["perceivedObjects"]
        after = self.falsify(step, OwnCpm(one, list(listed), frame))[:MAX_OBJECTS]
        if after == listed:
            return one
        count = before["numberOfPerceivedObjects"] + len(after) - len(listed)
        containers[OBJECTS] = {
            **before,
            "numberOfPerceivedObjects": min(max(count, len(after)), MAX_OBJECTS),
            "perceivedObjects": after,
        }
        wrapped = [{"containerId": number, "containerData": data} for number, data in containers.items()]
        payload = CPM_CODEC.encode({**tree, "payload": {**tree["payload"], "cpmContainers": wrapped}})
        return replace(one, payload=payload)

    def target(self, step: V2xStep, attacker: int) -> RadioPlace | None:
        """The victim, or the attacker itself without one; None while it is not on the road."""
        victim = self.context.victim
        return self.context.radio(step, attacker if victim is None else victim)


@dataclass
class _Ghost:
    """A ghost object of one attacker: its pose (4, 4) on the ground, and its id in the CPMs."""

    map_SE3_base: Float64
    object_id: int


class CpmGhost(CpmAttack):
    """Adds a standing ghost object: a car ahead of the victim, or of each attacker without a victim.

    It stands `ahead_m` in front of the target and `left_m` to the side until the target has passed it; then
    another follows. place: `ahead`, or `random`, anywhere within `ahead_m` of the target, the baseline with
    the same number of objects. label: the class that is claimed.
    """

    traits = V2xTraits(untrue=(PERCEIVED,), every_message_matters=True, message_types=(CPM.name,))

    def __init__(
        self,
        context: AttackContext,
        *,
        ahead_m: float = 25.0,
        left_m: float = 0.0,
        label: str = "car",
        place: str = "ahead",
    ) -> None:
        super().__init__(context)
        self._ahead_m = checked_number(context.name, "ahead_m", ahead_m, 1, 200)
        self._left_m = checked_number(context.name, "left_m", left_m, -50, 50)
        self._label = checked_choice(context.name, "label", label, ("car", "truck", "cyclist", "pedestrian"))
        self._place = checked_choice(context.name, "place", place, ("ahead", "random"))
        self._ghosts: dict[int, _Ghost] = {}

    def falsify(self, step: V2xStep, cpm: OwnCpm) -> list[MessageTree]:
        attacker = cpm.sent.station_id
        target = self.target(step, attacker)
        if target is None:
            return cpm.objects
        ghost = self._ghosts.get(attacker)
        if ghost is None or self._is_passed(target, ghost):
            ghost = self._ghosts[attacker] = self._new(cpm, target)
        x_m, y_m = ghost.map_SE3_base[:2, 3].tolist()
        east_m, north_m = cpm.frame.to_east_north(x_m, y_m)
        if math.hypot(east_m, north_m) > NOWHERE_NEAR_M:
            return cpm.objects
        length_m, width_m, height_m = _SIZES_M[self._label]
        claimed = PerceivedObject(
            object_id=ghost.object_id,
            measured_ms=0,
            east_m=east_m,
            north_m=north_m,
            up_m=height_m / 2,
            east_mps=0.0,
            north_mps=0.0,
            label=self._label,
            yaw_rad=(yaw_of(ghost.map_SE3_base) - cpm.frame.turn_rad) % math.tau,
            length_m=length_m,
            width_m=width_m,
            height_m=height_m,
            position_std_m=0.2,
            speed_std_mps=0.1,
            yaw_std_rad=math.radians(1.0),
            age_ms=1500,
            sensor_ids=(OWN_SENSOR_ID,),
        )
        return [*cpm.objects, object_tree(claimed)]

    def _new(self, cpm: OwnCpm, target: RadioPlace) -> _Ghost:
        attacker = cpm.sent.station_id
        rng = self.context.rng("ghost", attacker, cpm.sent.number)
        offset_m = target.size_m[0] / 2 + self._ahead_m, self._left_m
        if self._place == "random":
            radius_m, angle_rad = self._ahead_m * math.sqrt(rng.random()), math.tau * rng.random()
            offset_m = radius_m * math.cos(angle_rad), radius_m * math.sin(angle_rad)
        pose = target.map_SE3_base.copy()
        pose[:3, 3] = transform_points(pose, [*offset_m, 0.0])
        taken = {each["objectId"] for each in cpm.objects if "objectId" in each}
        while (object_id := int(rng.integers(1 << 16))) in taken:
            pass
        return _Ghost(pose, object_id)

    def _is_passed(self, target: RadioPlace, ghost: _Ghost) -> bool:
        away_m = ghost.map_SE3_base[:3, 3] - target.map_SE3_base[:3, 3]
        if self._place == "random":
            return math.hypot(*away_m[:2]) > 2 * self._ahead_m
        return bool(away_m @ target.map_SE3_base[:3, 0] < 0) or math.hypot(*away_m[:2]) > 4 * self._ahead_m


class CpmRemove(CpmAttack):
    """Leaves out the objects nearest to the victim, or to each attacker without a victim.

    objects: how many at most. within_m: only those nearer to the target than this. choice: `nearest`, or
    `random`, the baseline with the same number of objects.
    """

    traits = V2xTraits(untrue=(PERCEIVED,), every_message_matters=True, message_types=(CPM.name,))

    def __init__(
        self, context: AttackContext, *, objects: int = 3, within_m: float = 50.0, choice: str = "nearest"
    ) -> None:
        super().__init__(context)
        self._count = checked_integer(context.name, "objects", objects, 1, MAX_OBJECTS)
        self._within_m = checked_number(context.name, "within_m", within_m, 1, NOWHERE_NEAR_M)
        self._choice = checked_choice(context.name, "choice", choice, ("nearest", "random"))

    def falsify(self, step: V2xStep, cpm: OwnCpm) -> list[MessageTree]:
        target = self.target(step, cpm.sent.station_id)
        if target is None:
            return cpm.objects
        at_m = target.map_SE3_base[:2, 3].tolist()
        away_m = [math.dist(cpm.place_m(each), at_m) for each in cpm.objects]
        near = [index for index, distance_m in enumerate(away_m) if distance_m <= self._within_m]
        if self._choice == "random":
            rng = self.context.rng("removed", cpm.sent.station_id, cpm.sent.number)
            removed = set(rng.permutation(len(away_m))[: min(self._count, len(near))].tolist())
        else:
            removed = set(sorted(near, key=lambda index: away_m[index])[: self._count])
        return [each for index, each in enumerate(cpm.objects) if index not in removed]


class CpmShift(CpmAttack):
    """Moves all reported objects by a constant distance.

    direction_deg: counter-clockwise from the attacker's heading. direction: `constant`, or `random` for each
    object, the baseline with the same distance.
    """

    traits = V2xTraits(untrue=(PERCEIVED,), every_message_matters=True, message_types=(CPM.name,))

    def __init__(
        self,
        context: AttackContext,
        *,
        distance_m: float = 5.0,
        direction_deg: float = 90.0,
        direction: str = "constant",
    ) -> None:
        super().__init__(context)
        if distance_m == 0:
            raise UsageError(f"{context.name}: distance_m is 0, which moves nothing")
        self._distance_m = checked_number(context.name, "distance_m", distance_m, 0.01, 200)
        self._direction_rad = math.radians(
            checked_number(context.name, "direction_deg", direction_deg, -360, 360)
        )
        self._direction = checked_choice(context.name, "direction", direction, ("constant", "random"))
        self._angles_rad: dict[tuple[int, int], float] = {}

    def falsify(self, step: V2xStep, cpm: OwnCpm) -> list[MessageTree]:
        radio = self.context.radio(step, cpm.sent.station_id)
        if radio is None:
            return cpm.objects
        yaw_rad = yaw_of(radio.map_SE3_base) - cpm.frame.turn_rad
        return [self._moved(cpm.sent.station_id, yaw_rad, each) for each in cpm.objects]

    def _moved(self, attacker: int, yaw_rad: float, values: MessageTree) -> MessageTree:
        angle_rad = yaw_rad + self._direction_rad
        if self._direction == "random":
            key = attacker, values.get("objectId", -1)
            if key not in self._angles_rad:
                self._angles_rad[key] = math.tau * self.context.rng("shift", *key).random()
            angle_rad = self._angles_rad[key]
        position: dict[str, Any] = dict(values["position"])
        for axis, part in (("xCoordinate", math.cos(angle_rad)), ("yCoordinate", math.sin(angle_rad))):
            moved_m = position[axis]["value"] / c.COORDINATE.per_unit + part * self._distance_m
            position[axis] = {**position[axis], "value": c.COORDINATE.code(moved_m)}
        return {**values, "position": position}


_SIZES_M = {
    "car": (4.5, 1.8, 1.5),
    "truck": (8.0, 2.5, 3.2),
    "cyclist": (1.8, 0.6, 1.7),
    "pedestrian": (0.5, 0.5, 1.7),
}
"""Length, width and height of a ghost object."""
