"""The search for adversarial points by which the recipes of `perturb` differ."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]
Bool = npt.NDArray[np.bool_]


class Search(Protocol):
    """One cloud under attack, of points (N, 4): x, y, z, intensity."""

    def candidates(self, steps: int) -> Iterator[Float32]:
        """At least one and at most `steps` candidates (N, 4), one after the other. Raises NoGradientError if
        the loss has no gradient from the start."""

    def accept(self, better: Bool) -> None:
        """Called after each candidate with the points (N,) for which it is the best so far."""
