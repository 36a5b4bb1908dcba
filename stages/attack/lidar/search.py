"""How a perturbation looks for points that do harm: what recipes differ in."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]
Bool = npt.NDArray[np.bool_]


class Search(Protocol):
    """One cloud under attack, of points (N, 4): x, y, z, intensity."""

    def attempts(self, steps: int) -> Iterator[Float32]:
        """At most so many attempts (N, 4), one after the other; at least one. Raises NoGradientError where
        there is nothing to follow from the start."""

    def keep(self, better: Bool) -> None:
        """Takes for which points (N,) the latest attempt is the best one yet."""
