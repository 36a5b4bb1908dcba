"""A clean bag against one adversarial bag, frame by frame: what the detector made of each cloud."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.protocol import Detections
from advpipe.stages.evaluate.detection.scoring import Matches, Truth

Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class CloudResult:
    """What the detector made of one cloud, and how far the cloud is from the clean one.

    box_points: (K,) points of the cloud in the box of each detection.
    """

    detections: Detections
    matches: Matches
    box_points: Int64
    points: int
    points_removed: int = 0
    points_added: int = 0
    points_moved: int = 0
    max_displacement_m: float = 0.0
    chamfer_distance_m2: float = 0.0
    objects_below_min_points: int = 0


@dataclass(frozen=True)
class FrameResult:
    """One frame: its ground truth and up to three clouds of it. Indices count in their own bag."""

    index: int
    adversarial_index: int
    stamp_ns: int
    truth: Truth
    clean: CloudResult
    adversarial: CloudResult | None = None
    baseline: CloudResult | None = None

    def clouds(self) -> dict[str, CloudResult]:
        """The clouds that there are, by the word that reports use."""
        given = {"clean": self.clean, "adv": self.adversarial, "baseline": self.baseline}
        return {word: result for word, result in given.items() if result is not None}


@dataclass(frozen=True)
class Comparison:
    """The frames of one adversarial bag, or of the clean bag alone."""

    bag: Path | None
    provenance: Mapping[str, str]
    frames: tuple[FrameResult, ...]

    @property
    def name(self) -> str:
        return bag_name(self.bag) if self.bag else "clean"


def bag_name(bag: Path) -> str:
    """The folder of a bag, or its file without `.mcap`."""
    return bag.stem if bag.suffix == ".mcap" else bag.name
