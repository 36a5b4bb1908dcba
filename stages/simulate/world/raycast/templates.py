"""Plants drawn once and placed many times, each time turned and scaled."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.stages.simulate.world.raycast import leaves, trees
from advpipe.stages.simulate.world.raycast.mesh import Mesh

OF_A_KIND = 4
TREES: tuple[trees.Tree, ...] = (
    trees.broad_leaved, trees.slender, trees.columnar, trees.conifer, trees.bare, trees.shrub_tree,
)  # fmt: skip
STREET_SHARES = (0.55, 0.33, 0.0, 0.0, 0.12, 0.0)
GARDEN_SHARES = (0.32, 0.12, 0.08, 0.17, 0.09, 0.22)


class Plants:
    """Some trees of each kind, bushes and tufts of grass."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._trees = [[build(rng) for _ in range(OF_A_KIND)] for build in TREES]
        self._bushes = [leaves.bush(rng) for _ in range(2 * OF_A_KIND)]
        self._tufts = [leaves.tall_grass(rng) for _ in range(2 * OF_A_KIND)]

    def tree(self, rng: np.random.Generator, shares: tuple[float, ...] = GARDEN_SHARES) -> Mesh:
        """One of `TREES`, by their shares."""
        return _varied(self._trees[int(rng.choice(len(TREES), p=shares))], rng)

    def bush(self, rng: np.random.Generator) -> Mesh:
        return _varied(self._bushes, rng)

    def tall_grass(self, rng: np.random.Generator) -> Mesh:
        return _varied(self._tufts, rng)


def _varied(templates: list[Mesh], rng: np.random.Generator) -> Mesh:
    mesh = templates[int(rng.integers(len(templates)))]
    across, up = rng.uniform(0.9, 1.2, 2)
    return mesh.transformed(se3_from_yaw((0, 0, 0), rng.uniform(0, 2 * np.pi))).scaled(across, across, up)
