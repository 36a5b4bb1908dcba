"""Candidate places of new points: within reach of the clean cloud's points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.constraints import Rules, along_rays
from advpipe.pipeline.adversary.displacement import ROUNDING_MARGIN
from advpipe.pipeline.adversary.goal import owners
from advpipe.pipeline.baselines import move_within, random_offsets

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

_MAX_DRAWS = 50


@dataclass(frozen=True)
class Places:
    """C candidate places for added points.

    points: (C, 4) float32 x, y, z, and the intensity of the clean point that each starts from.
    source: (C,) the index of that point. distance_m: (C,) float64 from it, as stored. owner: (C,) the box
    that each place belongs to, -1 for none.
    """

    points: Float32
    source: Int64
    distance_m: Float64
    owner: Int64

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, chosen: npt.NDArray[np.generic]) -> Places:
        return Places(self.points[chosen], self.source[chosen], self.distance_m[chosen], self.owner[chosen])


def ball_places(
    clean: Float32,
    sources: Int64,
    count: int,
    boxes: Float64,
    rules: Rules,
    eps_m: float,
    margin_m: float,
    rng: np.random.Generator,
) -> Places:
    """`count` random places, each uniform in the ball around one of the sources, like those of the baseline
    `baselines.add_random_points`; fewer if the constraints permit hardly any."""
    drawn, have = [no_places()], 0
    for _ in range(_MAX_DRAWS if len(sources) else 0):
        source = rng.choice(sources, size=count)
        offset = random_offsets(count, eps_m, rng)
        if rules.constraints.along_ray:
            offset = along_rays(clean[source, :3], offset)
        drawn.append(places_at(clean, source, offset, boxes, margin_m, eps_m, rules))
        have += len(drawn[-1])
        if have >= count:
            break
    return joined(drawn)[np.arange(min(count, have))]


def places_at(
    clean: Float32,
    source: Int64,
    offset_m: Float64,
    boxes: Float64,
    margin_m: float,
    eps_m: float,
    rules: Rules,
) -> Places:
    """The places at these offsets (K, 3) from clean points that the reach and the constraints permit."""
    start = clean[source, :3]
    points = clean[source].copy()
    points[:, :3] = move_within(start, offset_m * (1 - ROUNDING_MARGIN))
    distance_m = np.linalg.norm(points[:, :3].astype(np.float64) - start, axis=1)
    kept = np.flatnonzero((distance_m <= eps_m) & rules.permits(points[:, :3]))
    owner = owners(points[kept, :3], boxes, margin_m)
    return Places(points[kept], source[kept], distance_m[kept], owner)


def with_drawn_intensities(places: Places, clean: Float32, rng: np.random.Generator) -> Places:
    """The places with intensities drawn uniformly over those of the clean points (N, 4)."""
    points, known = places.points.copy(), clean[:, 3]
    points[:, 3] = rng.uniform(known.min(), known.max(), len(points))
    return replace(places, points=points)


def no_places() -> Places:
    """Not one place."""
    none = np.zeros(0, np.int64)
    return Places(np.zeros((0, 4), np.float32), none, np.zeros(0), none)


def joined(parts: list[Places]) -> Places:
    """All places of several parts, in order."""
    return Places(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.source for part in parts]),
        np.concatenate([part.distance_m for part in parts]),
        np.concatenate([part.owner for part in parts]),
    )
