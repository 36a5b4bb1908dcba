"""What a detector expects of clouds: the LiDAR's height above the ground, and the range of intensities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.lidar_height import HIGHEST_M, LOWEST_M
from advpipe.pipeline.detector.protocol import ObjectDetector

BRIGHTEST = 1.0
"""The highest intensity of advpipe's own clouds."""


@dataclass(frozen=True)
class ExpectedInput:
    """The clouds that a detector was made for.

    lidar_height_m: of the origin of coordinates above the ground, which is level. max_intensity: intensities
    go from 0 to this. tolerated_m, tolerated_rad: a LiDAR that is this much higher or lower, or tilted by
    this much, costs little.
    """

    lidar_height_m: float
    max_intensity: float = BRIGHTEST
    tolerated_m: float = 0.15
    tolerated_rad: float = 0.0175


HEIGHT_KEY = "lidar_height_m"
"""Provenance key of a checkpoint: the height of the LiDARs of its training drives, in metres."""


def with_trained_height(
    expected: ExpectedInput | None, provenance: Mapping[str, str]
) -> ExpectedInput | None:
    """What a preset expects, at the height of a checkpoint's training drives, if it says that."""
    try:
        height_m = float(provenance[HEIGHT_KEY])
    except (KeyError, ValueError):
        return expected
    if not LOWEST_M <= height_m <= HIGHEST_M:
        return expected
    return ExpectedInput(height_m) if expected is None else replace(expected, lidar_height_m=height_m)


@runtime_checkable
class DeclaresInput(Protocol):
    """A detector that says what it expects; a user's class may implement it."""

    @property
    def expected_input(self) -> ExpectedInput | None:
        """What it expects; None where that is unknown."""


def expected_input_of(detector: ObjectDetector) -> ExpectedInput | None:
    """What a detector expects; None for one that does not say. Raises UsageError for another type."""
    expected = detector.expected_input if isinstance(detector, DeclaresInput) else None
    if expected is None or isinstance(expected, ExpectedInput):
        return expected
    name = type(detector).__name__
    raise UsageError(f"{name}.expected_input is {expected!r}; give an advpipe.ExpectedInput")
