"""What `report.json` lists as `cooperative`."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.results.listed import Listed


@dataclass(frozen=True)
class CooperativeRecord(Listed):
    """AP in [0, 1] of one class; NaN without objects. poses: alone, true poses, clean poses (as the clean bag
    reports them, with the errors of the filters on board), or the bag that reports."""

    poses: str
    fusion: str
    label: str
    frames: int
    objects: int
    ap_strict: float
    ap_loose: float
    misalignment_m: float
    misalignment_deg: float
