"""Out-of-range values: UPER can encode them, but no vehicle has them (TS 102 894-2)."""

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
"""The out-of-range ASN.1 values of each field."""
ALL = "all"


class OutOfRange(V2xAttack):
    """Sets one field, or all of them, to values that the ASN.1 allows but no receiver can use.

    The messages stay valid UPER. A Local Dynamic Map accepts one without a position; how it handles the other
    fields depends on its implementation.
    """

    traits = V2xTraits(
        untrue=tuple(claim for claim in ALL_CLAIMS if claim not in ("station id", "generation time"))
    )

    def __init__(self, context: AttackContext, *, field: str = ALL) -> None:
        super().__init__(context)
        chosen = checked_choice(context.name, "field", field, (ALL, *CODES))
        self._codes = [code for name, codes in CODES.items() if chosen in (ALL, name) for code in codes]

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        return [self._with_codes(message) if self.context.acts(message) else message for message in sent]

    def _with_codes(self, message: Sent) -> Sent:
        cams = self.context.cams
        tree: CamTree | None = cams.open(message.payload)
        if tree is None:
            return message
        for path, code in self._codes:
            tree = with_code(tree, path, code)
        return replace(message, payload=cams.close(tree))
