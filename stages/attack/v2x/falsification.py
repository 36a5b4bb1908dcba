"""What all attackers have in common that change what their own messages say."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack
from advpipe.stages.attack.v2x.cams import field_of, with_fields
from advpipe.stages.attack.v2x.claimed_path import ClaimedPath

REFERENCE_POINT_M = "front_m"
"""Beside the fields of a CAM: x and y of the reference point in the map's frame."""


@dataclass(frozen=True, slots=True)
class OwnMessage:
    """An attacker's message before it lies.

    front_m: x and y of the reference point, the middle of its front side, in the map's frame; NaN where it is
    not told.
    """

    station_id: int
    time_ns: int
    tree: CamTree
    front_m: tuple[float, float]

    def says(self, field: str) -> Any:
        """A field of the CAM; see `cams.field_of`."""
        return field_of(self.tree, field)


class Falsification(V2xAttack):
    """Changes fields of its attackers' own messages; whatever else they say is left to the bit.

    A message that is no CAM, or no vehicle's, is handed on as it is.
    """

    _moves: ClassVar[bool] = False
    """Whether `lie` needs the message's place on the map."""

    def __init__(self, context: AttackContext) -> None:
        super().__init__(context)
        self._path: ClaimedPath | None = None

    @abstractmethod
    def lie(self, message: OwnMessage) -> Mapping[str, Any]:
        """The fields that the message is to tell otherwise (`cams.FIELDS`, `REFERENCE_POINT_M`); messages come in order
        of time."""

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        cams, attacking, edited = self.context.cams, self.context.attacking, list(sent)
        found = [
            (index, one, tree, is_lie)
            for index, one in enumerate(sent)
            if one.station_id in attacking
            and ((is_lie := self.context.active(one.request_ns)) or self._path is not None)
            and (tree := cams.open(one.payload)) is not None
        ]
        fronts_m = self._fronts_m([tree for _, _, tree, _ in found])
        lies = [
            dict(self.lie(OwnMessage(one.station_id, one.request_ns, tree, front_m))) if is_lie else {}
            for (_, one, tree, is_lie), front_m in zip(found, fronts_m, strict=True)
        ]
        self._to_geographic(lies)
        for (index, one, tree, is_lie), fields in zip(found, lies, strict=True):
            false = with_fields(tree, **fields)
            if self._path is not None:
                false = self._path.follow(one, false, is_lie)
            if false is not tree:
                edited[index] = replace(one, payload=cams.close(false))
        return edited

    def _fronts_m(self, trees: Sequence[CamTree]) -> list[tuple[float, float]]:
        """Where all of them claim to be, in one go."""
        if not self._moves or not trees:
            return [(np.nan, np.nan)] * len(trees)
        degrees = [
            [np.nan if (degree := field_of(tree, name)) is None else degree for tree in trees]
            for name in ("latitude_deg", "longitude_deg")
        ]
        x_m, y_m, _ = self.context.geodesy.to_map([*degrees, [0.0] * len(trees)])
        return list(zip(x_m.tolist(), y_m.tolist(), strict=True))

    def _to_geographic(self, lies: Sequence[dict[str, Any]]) -> None:
        """Latitude and longitude instead of places on the map."""
        moved = [fields for fields in lies if REFERENCE_POINT_M in fields]
        if not moved:
            return
        x_m, y_m = zip(*(fields.pop(REFERENCE_POINT_M) for fields in moved), strict=True)
        latitude_deg, longitude_deg, _ = self.context.geodesy.to_geographic([x_m, y_m, [0.0] * len(moved)])
        for fields, north, east in zip(moved, latitude_deg.tolist(), longitude_deg.tolist(), strict=True):
            if np.isfinite(north + east):
                fields |= {"latitude_deg": north, "longitude_deg": east}


class PositionFalsification(Falsification):
    """A lie about the position.

    rebuild_path: the path history tells the places that the attacker has claimed, those of its honest
    messages before the attack as well; without it, it stays that of the true path, seen from the false
    position.
    """

    _moves = True

    def __init__(self, context: AttackContext, *, rebuild_path: bool = True) -> None:
        super().__init__(context)
        if rebuild_path:
            self._path = ClaimedPath(context.v2x.cam.path_points)
