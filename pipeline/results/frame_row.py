"""One frame in counts: a row of `frames.parquet`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CloudCounts:
    """What is counted in one cloud of a frame, the clean one too, at the working point of its report.

    Displacements are over the moved points of the cloud, 0 without any; max_added_m: from an added point to
    the nearest clean one. lost_objects: found on the clean cloud and missed here, at loose overlap;
    recounted, without those that have too few points left. displaced_objects: found on the clean cloud at
    strict overlap and here at loose overlap only.
    """

    points: int
    points_removed: int
    points_added: int
    points_moved: int
    mean_displacement_m: float
    rms_displacement_m: float
    median_displacement_m: float
    p95_displacement_m: float
    max_displacement_m: float
    max_added_m: float
    chamfer_distance_m2: float
    objects_below_min_points: int
    found_objects: int
    false_positives: int
    lost_objects: int
    new_false_positives: int
    lost_objects_recounted: int
    displaced_objects: int


@dataclass(frozen=True, slots=True)
class FrameRow:
    """Index of the frame in the clean bag, stamp, number of evaluated objects, and the counts of each cloud
    that it has, by condition: a column's name is `points_adv`, the field's and the condition's.

    ignored_objects, ignored_regions: labelled objects and parts of space that count neither way.
    """

    frame: int
    stamp_ns: int
    objects: int
    ignored_objects: int
    ignored_regions: int
    clouds: Mapping[str, CloudCounts]

    def count(self, condition: str, name: str) -> int | float | None:
        """A field of the counts of one cloud; None where the frame has no such cloud."""
        counts = self.clouds.get(condition)
        return None if counts is None else getattr(counts, name)
