"""The search for adversarial points by which the recipes of `perturb` differ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.protocol import Detections

Float32 = npt.NDArray[np.float32]
Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Candidate:
    """points: (N, 4) x, y, z, intensity. found: what the detector finds in those that the focus shows, where
    the pass of the gradient told it."""

    points: Float32
    found: Detections | None = None


class Search(Protocol):
    """One cloud under attack, of points (N, 4): x, y, z, intensity."""

    def candidates(self, steps: int) -> Iterator[Candidate]:
        """At least one candidate after the other, of `steps` gradients or draws. Raises NoGradientError if
        the loss has no gradient from the start."""

    def accept(self, better: Bool) -> None:
        """Called after each candidate with the points (N,) for which it is the best so far."""
