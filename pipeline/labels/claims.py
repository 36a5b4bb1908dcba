"""What a CAM claims of its sender: each claim is stated by some of the message's fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

from advpipe.pipeline.v2x.facilities.cam_values import SEPARATOR

Claim = Literal[
    "position",
    "speed",
    "heading",
    "turning",
    "acceleration",
    "dimensions",
    "station id",
    "station type",
    "generation time",
    "perceived objects",
]
KNOWN_CLAIMS: tuple[Claim, ...] = get_args(Claim)

CLAIM_FIELDS: Mapping[Claim, tuple[str, ...]] = {
    "position": ("latitude_deg", "longitude_deg", "altitude_m"),
    "speed": ("speed_mps",),
    "heading": ("heading_rad",),
    "turning": ("curvature_per_m", "yaw_rate_radps"),
    "acceleration": ("longitudinal_acceleration_mps2", "acceleration_control"),
    "dimensions": ("length_m", "width_m"),
    "station id": ("station_id",),
    "station type": ("station_type",),
    "generation time": ("generation_delta_time_ms",),
}
"""All of `cam_values.FIELDS`, by the claim that they state."""

ALL_CLAIMS: tuple[Claim, ...] = tuple(CLAIM_FIELDS)
"""All claims of a CAM; CPMs claim perceived objects, too."""

_CLAIM_OF = {field: claim for claim, fields in CLAIM_FIELDS.items() for field in fields}


def undeclared_fields(changed: str, untrue: frozenset[str]) -> list[str]:
    """The changed fields of a message (from `cam_values.changed_fields`) that belong to no claim declared
    untrue.

    Values without a field of their own (`cam_values.OTHER`: confidences, the path history) belong to every
    claim.
    """
    return [
        field
        for field in changed.split(SEPARATOR)
        if (_CLAIM_OF[field] not in untrue if field in _CLAIM_OF else not untrue)
    ]
