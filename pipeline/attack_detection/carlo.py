"""CARLO (Sun et al., "Towards Robust LiDAR-based Perception in Autonomous Driving", USENIX Security 2020,
section 7): real vehicles stop the rays that meet their boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.base import DefenderKnowledge, Suspicion, finite_points, worst
from advpipe.pipeline.attack_detection.box_frustum import BoxFrustum, box_frustums
from advpipe.pipeline.attack_detection.rehearsal import spoofed_objects
from advpipe.pipeline.core.index_ranges import index_ranges
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.messages.cloud import Cloud

Float64 = npt.NDArray[np.float64]

VEHICLES = [CLASSES.index(name) for name in ("car", "truck")]
"""The labels of what CARLO judges."""

CELL_M = 0.25
"""The edge of the cells of free space detection, as in the paper."""

STEP_M = 0.05
"""Between the places on a ray that mark cells as free: a cell that a ray crosses for less may be missed."""

SLACK = 0.05
"""The paper's epsilon, to which it gives no value."""

BOUND_QUANTILE = 0.995
"""The bounds of a distribution are this quantile and the opposite one: the paper reads them off curves."""


@dataclass(frozen=True)
class CarloLimits:
    """The limits of Algorithm 1, fitted to valid and to spoofed vehicles.

    a_prime: the lower bound of g of spoofed ones, b_prime: the upper bound of g of valid ones; a and b: the
    same of f. Below a_prime - epsilon a vehicle is valid at once, above b_prime + epsilon it is fake at once,
    and between these it is fake where f reaches (a + b) / 2.
    """

    a_prime: float
    b_prime: float
    a: float
    b: float

    @classmethod
    def fitted(cls, valid: Sequence[BoxFrustum], spoofed: Sequence[BoxFrustum]) -> CarloLimits | None:
        """From the boxes of both kinds; None without any of one kind."""
        if not (valid and spoofed):
            return None
        return cls(
            float(np.quantile([each.penetration for each in spoofed], 1 - BOUND_QUANTILE)),
            float(np.quantile([each.penetration for each in valid], BOUND_QUANTILE)),
            float(np.quantile([free_share(each) for each in spoofed], 1 - BOUND_QUANTILE)),
            float(np.quantile([free_share(each) for each in valid], BOUND_QUANTILE)),
        )

    def score(self, frustum: BoxFrustum) -> tuple[float, bool]:
        """0 for a vehicle that is valid at once, f of one that is undecided, 1 + g of one that is fake at
        once; and whether it is fake."""
        penetration = frustum.penetration
        if penetration < self.a_prime - SLACK:
            return 0.0, False
        if penetration > self.b_prime + SLACK:
            return 1.0 + penetration, True
        free = free_share(frustum)
        return free, free >= (self.a + self.b) / 2


class CarloCheck:
    """Laser penetration detection, and free space detection where that is undecided (Algorithm 1).

    g is the share of returns behind a box among those whose rays meet it (Eq. 6), f the share of the box's
    cells that rays cross without a return (Eq. 5). Limits are fitted, as in the paper, to vehicles that are
    detected in clean clouds and to spoofed ones: the defender's own (`rehearsal`). Without vehicles in the
    clean clouds there are no limits, and f alone is the score. It was made for spoofed vehicles; other
    classes score 0.
    """

    def __init__(self, knowledge: DefenderKnowledge) -> None:
        valid: list[BoxFrustum] = []
        spoofed: list[BoxFrustum] = []
        for cloud, found in zip(knowledge.clean, knowledge.detections, strict=True):
            points, boxes = finite_points(cloud), found.boxes[np.isin(found.labels, VEHICLES)]
            valid += box_frustums(points, boxes)
            for each in spoofed_objects(points, boxes):
                spoofed += box_frustums(each.points, each.box[None])
        self.limits = CarloLimits.fitted(valid, spoofed)

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        judged = np.flatnonzero(np.isin(detections.labels, VEHICLES))
        scores, fake = np.zeros(len(detections)), np.zeros(len(detections), bool)
        frustums = box_frustums(finite_points(cloud), detections.boxes[judged])
        for number, frustum in zip(judged.tolist(), frustums, strict=True):
            if self.limits is None:
                scores[number] = free_share(frustum)
            else:
                scores[number], fake[number] = self.limits.score(frustum)
        return worst(scores, None if self.limits is None else fake)


def free_share(frustum: BoxFrustum) -> float:
    """The share of a box's cells that rays cross before they return; a cell with a return is not free."""
    shape = np.maximum(np.ceil(2 * frustum.half_m / CELL_M - 1e-9).astype(np.int64), 1)
    strides = np.array([shape[1] * shape[2], shape[2], 1])

    def cells(places: Float64) -> npt.NDArray[np.int64]:
        index = np.floor((places + frustum.half_m) / (2 * frustum.half_m) * shape).astype(np.int64)
        number: npt.NDArray[np.int64] = np.clip(index, 0, shape - 1) @ strides
        return number

    last_m = np.minimum(frustum.far_m, frustum.range_m)
    count = np.maximum(np.ceil((last_m - frustum.near_m) / STEP_M).astype(np.int64), 0)
    ray = np.repeat(np.arange(len(count)), count)
    step = index_ranges(np.zeros_like(count), count)
    along_m = frustum.near_m[ray] + (step + 0.5) * ((last_m - frustum.near_m) / np.maximum(count, 1))[ray]
    free = np.zeros(int(shape.prod()), bool)
    free[cells(frustum.origin + frustum.unit[ray] * along_m[:, None])] = True
    inside = np.flatnonzero((frustum.range_m >= frustum.near_m) & (frustum.range_m <= frustum.far_m))
    free[cells(frustum.origin + frustum.unit[inside] * frustum.range_m[inside, None])] = False
    return float(free.mean())
