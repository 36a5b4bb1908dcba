"""Shadow-Catcher (Hau et al., "Shadow-Catcher: Looking into Shadows to Detect Ghost Objects in Autonomous
Vehicle 3D Sensing", ESORICS 2021): behind a real object is a shadow without returns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.base import DefenderKnowledge, Suspicion, finite_points, worst
from advpipe.pipeline.attack_detection.rehearsal import spoofed_objects
from advpipe.pipeline.attack_detection.sensor_geometry import Directions
from advpipe.pipeline.attack_detection.shadow import PolarPoints, Shadow, ShadowReturns
from advpipe.pipeline.attack_detection.shadow_kind import ShadowKind, shadow_features
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import Cloud

Float64 = npt.NDArray[np.float64]

LOOKING_DOWN_RAD = np.deg2rad(-5.0)
"""Rays below this mostly return from the ground."""


class ShadowCatcherCheck:
    """Three steps for each detection: its shadow, an anomaly score, and the kind of an anomalous shadow.

    Shadow and score are those of `Shadow` and `ShadowReturns`. A score above a threshold is anomalous: the
    threshold that tells detections in clean clouds from spoofed ones best, as the paper reads it off a ROC
    curve. A classifier on the clusters of returns in an anomalous shadow (`shadow_kind`) tells a ghost object
    from an invalidation attack, which injects returns behind a real object so that it is taken for a ghost.
    Both are fitted to attacks of the defender's own on the clean clouds (`rehearsal`). `fake` are the ghosts.
    It was made for spoofed objects of any class.
    """

    def __init__(self, knowledge: DefenderKnowledge) -> None:
        self._ground_m = _ground_m(knowledge.clean)
        genuine: list[ShadowReturns] = []
        ghosts: list[ShadowReturns] = []
        invalidated: list[ShadowReturns] = []
        for cloud, found in zip(knowledge.clean, knowledge.detections, strict=True):
            points = finite_points(cloud)
            seen = PolarPoints.of(points)
            for box in found.boxes:
                shadow = Shadow.of(box, self._ground_m)
                genuine.append(shadow.returns(seen))
                invalidated.append(genuine[-1].and_others(shadow.injected(self._ground_m)))
            for each in spoofed_objects(points, found.boxes):
                ghosts += self._returns(each.points, each.box[None])
        self.threshold = best_threshold(_scores(genuine), _scores(ghosts))
        self.kind = ShadowKind.fitted(self._anomalous(ghosts), self._anomalous(invalidated))

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        found = self._returns(finite_points(cloud), detections.boxes)
        fake = [
            self.is_anomalous(each) and self.kind.is_ghost(shadow_features(each.points)) for each in found
        ]
        return worst(_scores(found), np.array(fake, bool) if np.isfinite(self.threshold) else None)

    def is_anomalous(self, found: ShadowReturns) -> bool:
        """Whether a real object would not have such a shadow."""
        return found.score > self.threshold

    def _returns(self, points: Float64, boxes: Float64) -> list[ShadowReturns]:
        """Of points (N, 3), those in the shadow of each box (M, 7)."""
        seen = PolarPoints.of(points)
        return [Shadow.of(box, self._ground_m).returns(seen) for box in boxes]

    def _anomalous(self, shadows: Sequence[ShadowReturns]) -> list[Float64]:
        """The features of those above the threshold."""
        return [shadow_features(each.points) for each in shadows if self.is_anomalous(each)]


def best_threshold(genuine: Float64, ghosts: Float64) -> float:
    """The threshold on scores with the largest sum of the shares of ghosts (G,) above it and of genuine
    shadows (N,) not above it (Youden 1950); infinite without scores of both."""
    if not (len(genuine) and len(ghosts)):
        return float("inf")
    tried = np.unique(np.concatenate([genuine, ghosts]))
    right = [(ghosts > limit).mean() + (genuine <= limit).mean() for limit in tried]
    return float(tried[int(np.argmax(right))])


def _ground_m(clean: Sequence[Cloud]) -> float:
    """The height of the ground from the sensor."""
    heights = []
    for cloud in clean:
        way = Directions.of(cloud)
        heights.append(cloud["z"][(way.elevation_rad < LOOKING_DOWN_RAD) & np.isfinite(way.range_m)])
    down = np.concatenate(heights)
    return float(np.median(down)) if len(down) else -np.inf


def _scores(shadows: Sequence[ShadowReturns]) -> Float64:
    return np.array([each.score for each in shadows])
