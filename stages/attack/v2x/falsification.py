"""The base of attacks that falsify fields of the attackers' own messages."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack
from advpipe.stages.attack.v2x.cams import field_of, position_deg, with_fields
from advpipe.stages.attack.v2x.claimed_path import ClaimedPath

REFERENCE_POINT_M = "reference_point_m"
"""A field besides those of a CAM: x and y of the reference point in the map's frame."""


class OwnMessage(NamedTuple):
    """An attacker's message before its falsification.

    reference_point_m: x and y of the reference point, the middle of the vehicle's front side, in the map's
    frame; NaN if the message does not contain it.
    """

    station_id: int
    time_ns: int
    tree: CamTree
    reference_point_m: tuple[float, float]

    def field(self, field: str) -> Any:
        """A field of the CAM; see `cams.field_of`."""
        return field_of(self.tree, field)


class Falsification(V2xAttack):
    """Falsifies fields of the attackers' own messages and leaves every other bit as it is.

    Messages that are not a vehicle's CAM stay unchanged.
    """

    _needs_position: ClassVar[bool] = False
    """Whether `falsify` needs the position on the map."""

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self._path: ClaimedPath | None = None

    @abstractmethod
    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        """The fields to change (`cams.FIELDS`, `REFERENCE_POINT_M`), with their false values.

        Called for each message of an attacker while the attack is active, in order of time. Every bit of a
        field that is not returned stays as it is.
        """

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        cams, attacking, edited = self.context.cams, self.context.attacking, list(sent)
        found = [
            (index, message, tree, is_attacked)
            for index, message in enumerate(sent)
            if message.station_id in attacking
            and ((is_attacked := self.context.active(message.request_ns)) or self._path is not None)
            and (tree := cams.open(message.payload)) is not None
        ]
        reference_points_m = self._reference_points_m([tree for _, _, tree, _ in found])
        changes = [
            dict(self.falsify(OwnMessage(message.station_id, message.request_ns, tree, reference_point_m)))
            if is_attacked
            else {}
            for (_, message, tree, is_attacked), reference_point_m in zip(
                found, reference_points_m, strict=True
            )
        ]
        self._to_geographic(changes)
        for (index, message, tree, is_attacked), fields in zip(found, changes, strict=True):
            falsified = with_fields(tree, **fields)
            if self._path is not None:
                falsified = self._path.follow(message, falsified, is_attacked and bool(fields))
            if falsified is not tree:
                edited[index] = message.with_payload(cams.close(falsified))
        return edited

    def _reference_points_m(self, trees: Sequence[CamTree]) -> list[tuple[float, float]]:
        """The reference points in the CAMs, converted together."""
        if not self._needs_position or not trees:
            return [(np.nan, np.nan)] * len(trees)
        degrees = np.array([position_deg(tree) for tree in trees], np.float64).T
        x_m, y_m, _ = self.context.geodesy.to_map([*degrees, np.zeros(len(trees))])
        return list(zip(x_m.tolist(), y_m.tolist(), strict=True))

    def _to_geographic(self, changes: Sequence[dict[str, Any]]) -> None:
        """Replaces places on the map by latitude and longitude."""
        moved = [fields for fields in changes if REFERENCE_POINT_M in fields]
        if not moved:
            return
        x_m, y_m = zip(*(fields.pop(REFERENCE_POINT_M) for fields in moved), strict=True)
        latitude_deg, longitude_deg, _ = self.context.geodesy.to_geographic([x_m, y_m, [0.0] * len(moved)])
        for fields, north, east in zip(moved, latitude_deg.tolist(), longitude_deg.tolist(), strict=True):
            if math.isfinite(north + east):
                fields |= {"latitude_deg": north, "longitude_deg": east}


class PositionFalsification(Falsification):
    """Falsifies the position.

    rebuild_path: rebuild the path history from the positions that the attacker has claimed, including those
    of its genuine messages before the attack; otherwise the true path stays, relative to the false position.
    """

    _needs_position = True

    def __init__(self, context: AttackContext, *, rebuild_path: bool = True) -> None:
        super().__init__(context)
        if rebuild_path:
            self._path = ClaimedPath(context.v2x.cam.path_points)
