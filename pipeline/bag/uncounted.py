"""What a recording leaves unlabelled or asks to ignore: it counts for no detector and against none."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.ground_truth import GroundTruth
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.regions import LabelCoverage
from advpipe.pipeline.messages.labels import IgnoredBoxes


@dataclass(frozen=True)
class Uncounted:
    """Labelled objects that count neither way, and where objects are labelled; in the LiDAR's frame.

    Objects of known classes whose centre lies outside the labelled regions are among `boxes`.
    """

    boxes: IgnoredBoxes = field(default_factory=IgnoredBoxes)
    coverage: LabelCoverage = field(default_factory=LabelCoverage)

    def __bool__(self) -> bool:
        return bool(len(self.boxes) or self.coverage.labelled or self.coverage.ignored)

    def ignores_centres(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which boxes (K, 7), such as detections, have their centre where nothing counts: (K,)."""
        return ~self.coverage.counts(boxes[:, :3])


def counted_truth(truth: GroundTruth | None, stamp_ns: int, lidar_frame: str) -> tuple[Boxes, Uncounted]:
    """The objects at an instant that count, in the LiDAR's frame, and what does not count; without ground
    truth, neither."""
    if truth is None:
        return Boxes(), Uncounted()
    boxes, ignored = truth.boxes(stamp_ns, lidar_frame), truth.ignored(stamp_ns, lidar_frame)
    coverage = truth.coverage(stamp_ns, lidar_frame)
    counts = coverage.counts(boxes.geometry[:, :3])
    if not counts.all():
        outside = boxes[~counts]
        ignored = IgnoredBoxes(
            np.concatenate([ignored.geometry, outside.geometry]),
            (*ignored.class_names, *(CLASSES[label] for label in outside.labels)),
            (*ignored.ids, *outside.ids),
        )
        boxes = boxes[counts]
    return boxes, Uncounted(ignored, coverage)
