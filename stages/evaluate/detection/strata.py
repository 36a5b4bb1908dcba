"""Parts of the ground truth that are scored separately, by range, number of points and occlusion.

KITTI's own parts, easy, moderate and hard, are defined in a camera's image (height of the box in pixels,
truncation), which a LiDAR's bag does not have: these stand in for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.metrics.matching import MatchTable
from advpipe.stages.evaluate.detection.comparison import FrameResult
from advpipe.stages.evaluate.detection.matches import labelled

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]

INFINITY = float("inf")


@dataclass(frozen=True)
class Stratum:
    """The boxes whose measure `by` is at least `low` and less than `high`."""

    by: str
    name: str
    low: float
    high: float

    def holds(self, values: Float64) -> Bool:
        """Which of the boxes lie in it, by their measure; where that is NaN, none does."""
        return (values >= self.low) & (values < self.high)


STRATA: tuple[Stratum, ...] = (
    Stratum("range", "0-30 m", 0, 30),
    Stratum("range", "30-50 m", 30, 50),
    Stratum("range", "over 50 m", 50, INFINITY),
    Stratum("points", f"{MIN_POINTS}-19", MIN_POINTS, 20),
    Stratum("points", "20-99", 20, 100),
    Stratum("points", "100+", 100, INFINITY),
    Stratum("occlusion", "0-10 %", 0, 0.1),
    Stratum("occlusion", "10-50 %", 0.1, 0.5),
    Stratum("occlusion", "over 50 %", 0.5, INFINITY),
)
"""range: of the centre from the LiDAR in the plane. points: of the clean cloud. occlusion: in [0, 1]."""


@dataclass(frozen=True)
class Measures:
    """The measures that strata are cut by, of the detections (K,) and the objects (M,) of a class.

    A false positive belongs to the strata of its own box: by its range, and by its points in the cloud, where
    fewer than `MIN_POINTS` belong to the lowest stratum. It has no occlusion, and counts against every
    stratum of occlusion.
    """

    detections: dict[str, Float64]
    truths: dict[str, Float64]

    @classmethod
    def of(cls, frames: Sequence[FrameResult], condition: str, name: str) -> Measures:
        """The measures of all frames in turn, as in `MatchTable.of`, under a condition."""
        detections: dict[str, list[Float64]] = {"range": [], "points": []}
        truths: dict[str, list[Float64]] = {"range": [], "points": [], "occlusion": []}
        for frame in frames:
            cloud, truth = frame.clouds()[condition], frame.truth
            mine = labelled(truth.boxes.labels, name)
            theirs = labelled(cloud.detections.labels, name)
            detections["range"].append(box_range_m(cloud.detections.boxes[theirs]))
            detections["points"].append(np.maximum(cloud.box_points[theirs], MIN_POINTS).astype(np.float64))
            truths["range"].append(box_range_m(truth.boxes.geometry[mine]))
            truths["points"].append(truth.points[mine].astype(np.float64))
            truths["occlusion"].append(truth.occlusion[mine])
        return cls(
            {measure: np.concatenate([np.zeros(0), *values]) for measure, values in detections.items()},
            {measure: np.concatenate([np.zeros(0), *values]) for measure, values in truths.items()},
        )

    def cut(self, table: MatchTable, stratum: Stratum) -> MatchTable:
        """The matches of these detections and objects, where only those in the stratum count."""
        detections = self.detections.get(stratum.by)
        everywhere = np.ones(len(table.detection_frame), dtype=bool)
        return table.within(
            stratum.holds(self.truths[stratum.by]),
            everywhere if detections is None else stratum.holds(detections),
        )


def box_range_m(boxes: Float64) -> Float64:
    """How far the centres of boxes (M, 7) are from the LiDAR in the plane: (M,)."""
    return np.hypot(boxes[:, 0], boxes[:, 1])
