"""The ray check: every return lies on the ray that its ring and its firing define."""

from __future__ import annotations

from advpipe.pipeline.attack_detection.base import DefenderKnowledge, Suspicion
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import Cloud


class RayCheck:
    """Compares the elevation of each point with that of its ring and, where the clean clouds show the columns
    of a turn, its azimuth with the nearest column. The score is the share of points off their ray."""

    def __init__(self, knowledge: DefenderKnowledge) -> None:
        self._sensor = knowledge.sensor

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        off = self._sensor.off_ray(cloud)
        return Suspicion(float(off.mean()) if len(off) else 0.0, points=off)
