"""The interface of checks that tell whether a cloud was attacked, from what a defender has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.protocol import Detections, VoxelGrid
from advpipe.pipeline.messages.cloud import Cloud, xyz

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]


class CheckNotApplicableError(AdvpipeError):
    """A check lacks what it needs, such as rings; its text ends the sentence "not run: ..."."""


@dataclass(frozen=True)
class DefenderKnowledge:
    """What a defender knows beforehand.

    clean: some clouds of the sensor that nobody attacked. grid: the voxels of its own detector, if any.
    detect: its own detector, its labels indices into `geometry.boxes.CLASSES`; None gives no detections.
    """

    clean: Sequence[Cloud]
    grid: VoxelGrid | None = None
    detect: Callable[[Cloud], Detections] | None = None

    @cached_property
    def detections(self) -> tuple[Detections, ...]:
        """What the detector finds in each of the clean clouds."""
        if self.detect is None:
            none = Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))
            return (none,) * len(self.clean)
        return tuple(self.detect(cloud) for cloud in self.clean)

    @cached_property
    def sensor(self) -> SensorGeometry:
        """The rays of the sensor as the clean clouds show them. Raises CheckNotApplicableError."""
        found = SensorGeometry.learnt(self.clean)
        if found is None:
            raise CheckNotApplicableError("the clouds do not say of which ring their points are")
        return found


@dataclass(frozen=True)
class Suspicion:
    """What a check says of one cloud (N,) with K detections.

    score: the higher, the more suspicious is the cloud; thresholds on it are calibrated on clean clouds.
    points: (N,) the points that it takes for changed; None for a check that judges no points. detections:
    (K,) scores on the scale of `score`, which is the largest of them; None if it judges none. fake: (K,) the
    detections that it takes for spoofed by limits of its own, of a published detector; None if it has none.
    """

    score: float
    points: Bool | None = None
    detections: Float64 | None = None
    fake: Bool | None = None


class AttackCheck(Protocol):
    """A check of single clouds. Its constructor takes the `DefenderKnowledge` alone, and raises
    CheckNotApplicableError where that does not suffice.

    One of your own is named `module:Class`.
    """

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        """The suspicion on a cloud (N,) with its detections, labelled by `geometry.boxes.CLASSES`; neither
        is modified."""


def worst(scores: Float64, fake: Bool | None = None) -> Suspicion:
    """The suspicion of a check that judges detections, by their scores (K,); 0 without detections. fake: (K,)
    those that it takes for spoofed, if it decides."""
    return Suspicion(float(scores.max(initial=0.0)), detections=scores, fake=fake)


def finite_points(cloud: Cloud) -> Float64:
    """The coordinates (K, 3) of the returns of a cloud that are finite and not at the sensor."""
    points = xyz(cloud).astype(np.float64)
    kept: Float64 = points[np.isfinite(points).all(axis=1) & (points != 0).any(axis=1)]
    return kept
