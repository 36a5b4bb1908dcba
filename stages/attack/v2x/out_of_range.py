"""Values that UPER can carry and the data dictionary (TS 102 894-2) gives no vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from advpipe.pipeline.labels.claims import ALL_CLAIMS
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.pipeline.v2x.facilities.cam_values import HIGH
from advpipe.stages.attack.bounds import checked_choice
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import with_code

_BASIC = ("cam", "camParameters", "basicContainer")
_FAST = ("cam", "camParameters", HIGH)
CODES: dict[str, tuple[tuple[tuple[str, ...], int], ...]] = {
    "position": (  # the North Pole on the date line
        ((*_BASIC, "referencePosition", "latitude"), 900_000_000),
        ((*_BASIC, "referencePosition", "longitude"), 1_800_000_000),
    ),
    "heading": (((*_FAST, "heading", "headingValue"), 3600),),  # "shall not be used"
    "speed": (((*_FAST, "speed", "speedValue"), 16_382),),  # out of range: beyond 163.81 m/s
    "acceleration": (  # 16 m/s2 or more
        ((*_FAST, "longitudinalAcceleration", "longitudinalAccelerationValue"), 160),
    ),
    "curvature": (((*_FAST, "curvature", "curvatureValue"), -1023),),  # a radius of 10 m or less
    "yaw-rate": (((*_FAST, "yawRate", "yawRateValue"), 32_766),),  # 327 degrees a second or more
    "length": (((*_FAST, "vehicleLength", "vehicleLengthValue"), 1022),),  # out of range: beyond 102.1 m
    "width": (((*_FAST, "vehicleWidth"), 61),),  # out of range: beyond 6 m
    "station-type": (((*_BASIC, "stationType"), 255),),  # no type has this number
}
"""The ASN.1 values that each field gets."""
ALL = "all"


class OutOfRange(V2xAttack):
    """One field, or all of them, at what the ASN.1 lets pass and no receiver can use.

    The messages stay valid UPER; a Local Dynamic Map takes one without a position, and what it makes of the
    others is its own affair.
    """

    traits = V2xTraits(
        untrue=tuple(one for one in ALL_CLAIMS if one not in ("station id", "generation time"))
    )

    def __init__(self, context: AttackContext, *, field: str = ALL) -> None:
        super().__init__(context)
        words = checked_choice(context.name, "field", field, (ALL, *CODES))
        self._codes = [code for name, codes in CODES.items() if words in (ALL, name) for code in codes]

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        return [self._broken(one) if self.context.acts(one) else one for one in sent]

    def _broken(self, one: Sent) -> Sent:
        cams = self.context.cams
        tree: CamTree | None = cams.open(one.payload)
        if tree is None:
            return one
        for path, code in self._codes:
            tree = with_code(tree, path, code)
        return replace(one, payload=cams.close(tree))
