"""What `report.json` lists as `cooperative`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Listed


@dataclass(frozen=True)
class CooperativeRecord(Listed):
    """AP in [0, 1] of one class; NaN without objects. poses: alone, true poses, clean poses (as the clean bag
    reports them, with the errors of the filters on board), or the bag that reports."""

    poses: Annotated[
        str,
        "`alone`, `true poses`, `clean poses` (of the clean bag) or an adversarial bag",
    ]
    fusion: Annotated[str, "`clouds`, `detections` or `CPMs`; empty for the vehicle alone"]
    label: Annotated[str, "object class"]
    frames: Annotated[int, "number of fused frames"]
    objects: Annotated[int, "number of objects to find"]
    ap_strict: Annotated[float, "average precision (R40) at strict overlap, in [0, 1]"]
    ap_loose: Annotated[float, "average precision (R40) at loose overlap, in [0, 1]"]
    misalignment_m: Annotated[
        float, "mean distance between true and reported pose of the other sensor, in metres"
    ]
    misalignment_deg: Annotated[
        float, "mean angle between true and reported pose of the other sensor, in degrees"
    ]
