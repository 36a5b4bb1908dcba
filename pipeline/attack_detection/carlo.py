"""CARLO (Sun et al., "Towards Robust LiDAR-based Perception in Autonomous Driving", USENIX Security 2020,
section 7): real vehicles stop the rays that meet their boxes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.base import DefenderKnowledge, Suspicion, worst
from advpipe.pipeline.attack_detection.box_frustum import BoxFrustum, box_frustums
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import Cloud, xyz

Float64 = npt.NDArray[np.float64]

CELL_M = 0.25
"""The edge of the cells of free space detection, as in the paper."""

STEP_M = 0.05
"""Between the places on a ray that mark cells as free: a cell that a ray crosses for less may be missed."""

SLACK = 0.05
"""The paper's epsilon, to which it gives no value."""

VALID_QUANTILE, FAKE_QUANTILE = 0.5, 0.995
"""Of the penetration of boxes in clean clouds: the limits below which a box is valid at once, and above which
it is fake at once."""


class CarloCheck:
    """Laser penetration detection, and free space detection where that is undecided.

    g is the share of returns behind a box among those whose rays meet it. A box of little g is valid, one of
    much is fake, and between these f decides: the share of the box's cells that rays cross without a return.
    The paper fits its limits to boxes of valid and of spoofed vehicles; a defender who knows no attack has
    the former alone, so that the limits of g are quantiles over clean clouds, and the threshold on f is
    calibrated. The score of a detection is 0 if it is valid at once, f if undecided, and 1 + g if it is fake
    at once. It was made for spoofed vehicles.
    """

    def __init__(self, knowledge: DefenderKnowledge) -> None:
        shares = [
            frustum.penetration
            for cloud, found in zip(knowledge.clean, knowledge.detections, strict=True)
            for frustum in box_frustums(_finite(cloud), found.boxes)
        ]
        self._valid = float(np.quantile(shares, VALID_QUANTILE)) if shares else 0.0
        self._fake = float(np.quantile(shares, FAKE_QUANTILE)) if shares else 1.0

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        return worst(np.array([self._score(each) for each in box_frustums(_finite(cloud), detections.boxes)]))

    def _score(self, frustum: BoxFrustum) -> float:
        penetration = frustum.penetration
        if penetration < self._valid - SLACK:
            return 0.0
        if penetration > self._fake + SLACK:
            return 1.0 + penetration
        return free_share(frustum)


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
    step = np.arange(len(ray)) - np.repeat(np.cumsum(count) - count, count)
    along_m = frustum.near_m[ray] + (step + 0.5) * ((last_m - frustum.near_m) / np.maximum(count, 1))[ray]
    free = np.zeros(int(shape.prod()), bool)
    free[cells(frustum.origin + frustum.unit[ray] * along_m[:, None])] = True
    inside = np.flatnonzero((frustum.range_m >= frustum.near_m) & (frustum.range_m <= frustum.far_m))
    free[cells(frustum.origin + frustum.unit[inside] * frustum.range_m[inside, None])] = False
    return float(free.mean())


def _finite(cloud: Cloud) -> Float64:
    points = xyz(cloud).astype(np.float64)
    kept: Float64 = points[np.isfinite(points).all(axis=1) & (points != 0).any(axis=1)]
    return kept
