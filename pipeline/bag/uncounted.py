"""What a recording leaves unlabelled or asks to ignore: it counts for no detector and against none."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.ground_truth import GroundTruth
from advpipe.pipeline.geometry.regions import LabelCoverage
from advpipe.pipeline.messages.labels import IgnoredBoxes


@dataclass(frozen=True, slots=True)
class Uncounted:
    """Labelled objects that count neither way, and where objects are labelled; in the LiDAR's frame.

    An object that is labelled counts wherever it is, as one does whose centre lies beside the image. A
    detection that finds none counts only where objects are labelled.
    """

    boxes: IgnoredBoxes = field(default_factory=IgnoredBoxes)
    coverage: LabelCoverage = field(default_factory=LabelCoverage)

    def __bool__(self) -> bool:
        return bool(len(self.boxes) or self.coverage.labelled or self.coverage.ignored)

    def ignores_centres(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which boxes (K, 7), such as detections, have their centre where nothing counts: (K,)."""
        return ~self.coverage.counts(boxes[:, :3])


def uncounted_at(truth: GroundTruth, stamp_ns: int, lidar_frame: str) -> Uncounted:
    """What does not count at an instant."""
    return Uncounted(truth.ignored(stamp_ns, lidar_frame), truth.coverage(stamp_ns, lidar_frame))
