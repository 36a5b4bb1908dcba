"""The ways in which a vehicle perceives: alone, with another's cloud or detections, or with CPMs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.evaluate.cooperative.fusion import fuse_clouds, fuse_detections, without_oneself
from advpipe.stages.evaluate.cooperative.heard_detections import HeardDetections
from advpipe.stages.evaluate.cooperative.heard_scenes import has_heard_objects
from advpipe.stages.evaluate.cooperative.pair import Alignment, Pair, SharedFrame
from advpipe.stages.evaluate.detection.scoring import CachedDetector

ALONE, TRUE, CLEAN = "alone", "true poses", "clean poses"
CLOUDS, DETECTIONS, HEARD = "clouds", "detections", "CPMs"


class Condition(NamedTuple):
    """poses: `ALONE`, `TRUE`, `CLEAN`, or the bag whose poses and CPMs are used. fusion: empty for the
    vehicle alone."""

    poses: str
    fusion: str = ""


class Conditions:
    """All conditions of a comparison. bags: `CLEAN` and the adversarial ones. moved: those of them whose
    poses are false: in others, fused clouds and detections are as in the clean bag."""

    def __init__(
        self,
        cached: CachedDetector,
        pair: Pair,
        bags: Mapping[str, BagReader],
        reported: Mapping[str, Alignment],
        moved: Sequence[str],
    ) -> None:
        self._cached, self._reported, self.moved = cached, reported, moved
        self._heard = {
            name: HeardDetections(bag, pair.own, cached.classes)
            for name, bag in bags.items()
            if has_heard_objects(bag, pair.own.vehicle)
        }
        self.all = (
            Condition(ALONE),
            *(Condition(name, fusion) for fusion in (CLOUDS, DETECTIONS) for name in (TRUE, CLEAN, *moved)),
            *(Condition(name, HEARD) for name in self._heard),
        )

    def see(self, condition: Condition, frame: SharedFrame, poses: Mapping[str, Float64]) -> Detections:
        """What the vehicle perceives in a frame. poses: own_SE3_other, by whose poses."""
        name, fusion = condition
        own, cached = frame.own.cloud, self._cached
        if fusion == CLOUDS:
            found = cached.detect(fuse_clouds(own, frame.other, poses[name]))
        elif fusion == DETECTIONS:
            found = fuse_detections(cached.detect(own), cached.detect(frame.other), poses[name])
        elif fusion == HEARD:
            stamp_ns = frame.own.stamp_ns
            heard = self._heard[name].at(stamp_ns, self._reported[name].own_SE3_map(stamp_ns))
            found = fuse_detections(cached.detect(own), heard, np.eye(4))
        else:
            found = cached.detect(own)
        return without_oneself(found)
