"""Lies about one's size."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.v2x.base import AttackContext, V2xTraits
from advpipe.stages.attack.v2x.falsification import Falsification, OwnMessage

LEAST_M = 0.1
MAX_LENGTH_M, MAX_WIDTH_M = 102.1, 6.0
"""The largest that a CAM can tell."""


class Dimensions(Falsification):
    """Longer and wider by these offsets (VASP's is 4 m), or smaller with negative ones; never below 0.1 m nor
    above what a CAM can tell. The front stays where it is, so the box grows backwards and to both sides."""

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
            if (told_m := message.field(name)) is not None:
                fields[name] = min(max(told_m + offset_m, LEAST_M), most_m)
        return fields
