"""One detection or one object of a frame, and what became of it: a row of `results.parquet`."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.results.column import Category, Number

DETECTION, TRUTH = "detection", "truth"
FOUND, MISSED, FALSE, IGNORED = "found", "missed", "false positive", "ignored"
"""A detection is `found`, a `false positive` or `ignored`; an object `found`, `missed` or `ignored`."""


@dataclass(frozen=True)
class MatchRow:
    """A detection on a cloud, or an object of its frame, with its number there.

    cloud: `clean`, `adv`, a baseline's name, or one of these under a defence. kind: `DETECTION` or `TRUTH`;
    what the other one has is None: id, occlusion, is_lost, is_displaced and is_emptied are an object's, score
    and is_new a detection's. Box: centre, size and yaw in the frame of the ground truth. points: of a
    detection in the cloud it was made on, of an object in the clean one. occlusion: in [0, 1]; None where
    the bag does not tell. fate: by each criterion one of `FOUND`, `MISSED`, `FALSE`, `IGNORED`. match: the
    number of the object or detection that it was matched with, None for none.

    At the working point: is_lost, found on the clean cloud at loose overlap and missed here; is_displaced,
    found there at strict overlap and here at loose overlap only; is_new, where there was nothing. is_emptied:
    with too few points left.
    """

    bag: Category
    detector: Category
    cloud: Category
    frame: int
    stamp_ns: int
    kind: Category
    number: Number
    class_name: Category
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
    fate_strict: Category
    fate_loose: Category
    fate_bev: Category
    fate_bev_loose: Category
    match_strict: Number | None
    match_loose: Number | None
    match_bev: Number | None
    match_bev_loose: Number | None
    is_lost: bool | None
    is_displaced: bool | None
    is_emptied: bool | None
    is_new: bool | None
