"""Which detector of ours proposes changes against one that shows no `occupancy_loss`."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.surrogate import SurrogateDetector
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.adapted import detector_for_cloud
from advpipe.pipeline.detector.protocol import ObjectDetector, VoxelDetector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.stages.attack.lidar.base import SURROGATE, LidarAttack


def with_surrogate(
    attack: LidarAttack,
    detector: ObjectDetector,
    adaptation: Adaptation,
    places: npt.NDArray[np.float32],
    device: str,
) -> ObjectDetector:
    """The detector as it is shown a cloud (N, 3), with a surrogate beside it that sees the cloud as itself
    expects it; the detector alone, if the attack has no use for a surrogate."""
    if not attack.uses_surrogate or isinstance(detector, VoxelDetector):
        return detector
    shipped = _shipped(device)
    placed, _ = detector_for_cloud(shipped, adaptation, places, shipped)
    return SurrogateDetector(detector, placed) if isinstance(placed, VoxelDetector) else detector


@cache
def _shipped(device: str) -> ObjectDetector:
    return load_detector(SURROGATE, device)
