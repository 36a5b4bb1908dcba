"""One detection or one object of a frame, and what became of it: a row of `results.parquet`."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.results.column import Number, Word

DETECTION, TRUTH = "detection", "truth"
FOUND, MISSED, FALSE, IGNORED = "found", "missed", "false positive", "ignored"
"""A detection is `found`, a `false positive` or `ignored`; an object `found`, `missed` or `ignored`."""


@dataclass(frozen=True)
class MatchRow:
    """A detection on a cloud, or an object of its frame, with its number there.

    cloud: `clean`, `adv`, a baseline's word, or one of these under a defence. kind: `DETECTION` or `TRUTH`;
    what the other one has is None: id, occlusion, is_lost and is_emptied are an object's, score and is_new a
    detection's. Box: centre, size and yaw in the frame of the ground truth. points: of a detection in the
    cloud it was made on, of an object in the clean one. occlusion: share hidden, in [0, 1]; None where the
    bag does not tell. fate: by each criterion one of `FOUND`, `MISSED`, `FALSE`, `IGNORED`. match: the number
    of the object or detection that it was matched with, None for none.

    At the working point: is_lost, found on the clean cloud and missed here; is_new, where there was nothing.
    is_emptied: with too few points left.
    """

    bag: Word
    detector: Word
    cloud: Word
    frame: int
    stamp_ns: int
    kind: Word
    number: Number
    class_name: Word
    id: str | None
    score: float | None
    x_m: float
    y_m: float
    z_m: float
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float
    points: int
    occlusion: float | None
    fate_strict: Word
    fate_loose: Word
    fate_bev: Word
    fate_bev_loose: Word
    match_strict: Number | None
    match_loose: Number | None
    match_bev: Number | None
    match_bev_loose: Number | None
    is_lost: bool | None
    is_emptied: bool | None
    is_new: bool | None
