"""Falsified vehicle dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.falsification import Falsification, OwnMessage

LEAST_M = 0.1
MAX_LENGTH_M, MAX_WIDTH_M = 102.1, 6.0
"""The largest dimensions that a CAM can encode."""


class Dimensions(Falsification):
    """Adds offsets to length and width (VASP adds 4 m), negative ones to make the vehicle smaller.

    The result stays between 0.1 m and the largest value that a CAM can encode. As the reference point is on
    the front side, the box grows backwards and to both sides.
    """

    traits = V2xTraits(untrue=("dimensions",))

    def __init__(self, context: AttackContext, *, length_m: float = 4.0, width_m: float = 1.0) -> None:
        super().__init__(context)
        self._length_m = checked_number(context.name, "length_m", length_m, -MAX_LENGTH_M, MAX_LENGTH_M)
        self._width_m = checked_number(context.name, "width_m", width_m, -MAX_WIDTH_M, MAX_WIDTH_M)

    def falsify(self, message: OwnMessage) -> Mapping[str, Any]:
        fields = {}
        for name, offset_m, most_m in (
            ("length_m", self._length_m, MAX_LENGTH_M),
            ("width_m", self._width_m, MAX_WIDTH_M),
        ):
            if (true_m := message.field(name)) is not None:
                fields[name] = min(max(true_m + offset_m, LEAST_M), most_m)
        return fields
