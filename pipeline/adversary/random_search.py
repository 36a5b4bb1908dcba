"""Random search: the random baselines with the same budget."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.constraints import Rules
from advpipe.pipeline.adversary.displacement import displaced
from advpipe.pipeline.geometry.lengths import lengths

Float32 = npt.NDArray[np.float32]
Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class RandomSearch:
    """Points (N, 4) moved by the whole reach in random directions, as far as the rules allow.

    near: (N,) the only points that move. Where intensities are attacked, they are drawn uniformly.
    """

    points: Float32
    rules: Rules
    near: Bool
    reach_m: float
    rng: np.random.Generator

    def candidates(self, steps: int) -> Iterator[Float32]:
        points, rules, rng = self.points, self.rules, self.rng
        for _ in range(steps):
            directions = rng.standard_normal((len(points), 3))
            directions *= self.reach_m / lengths(directions)[:, None]
            chosen = rules.limit(np.where(rules.allowed & self.near, rng.random(len(points)), 0))
            offset_m = rules.project(np.where(chosen[:, None], directions, 0.0))
            moved = displaced(points, offset_m, self.reach_m)
            if rules.constraints.intensity:
                drawn = rng.uniform(points[:, 3].min(), points[:, 3].max(), len(points)).astype(np.float32)
                moved[:, 3] = np.where(chosen, drawn, points[:, 3])
            yield moved

    def accept(self, better: Bool) -> None:
        """Ignored: candidates are independent of each other."""
