"""Random changes of a cloud under an attack's budget."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.baselines import move_within, random_directions, random_offsets
from advpipe.pipeline.defences.base import with_xyz
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference
from advpipe.stages.evaluate.detection.displacement import added_distance_m

Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SpentBudget:
    """What an attack spent on a cloud.

    removed, added: how many points. moved_m: (K,) how far each of the moved points went. reach_m: how far
    from the point that it starts at a new one may lie. bound_m: how far any point was allowed to move.
    intensity_changed: how many points got another intensity.
    """

    removed: int
    added: int
    moved_m: Float64
    reach_m: float
    bound_m: float
    intensity_changed: int = 0

    @classmethod
    def of(
        cls, clean: Cloud, adversarial: Cloud, change: CloudDifference, parameters: Mapping[str, object]
    ) -> SpentBudget:
        """The budget as spent; lengths are bounded as the attack states, in its `eps_cm` or `eps_m`.

        An attack that states none was bounded by the longest way that it went.
        """
        stated_m = stated_bound_m(parameters)
        return cls(
            len(change.removed),
            len(change.added),
            change.displacement_m,
            added_distance_m(clean, adversarial, change) if stated_m is None else stated_m,
            change.max_displacement_m if stated_m is None else stated_m,
            len(change.intensity_changed),
        )


def stated_bound_m(parameters: Mapping[str, object]) -> float | None:
    """How far an attack with these parameters may move a point, or put a new one from where it starts."""
    for name, unit_m in (("eps_cm", 0.01), ("eps_m", 1.0)):
        value = parameters.get(name)
        if isinstance(value, int | float):
            return value * unit_m
    return None


def random_change(cloud: Cloud, budget: SpentBudget, pool: Bool, rng: np.random.Generator) -> Cloud:
    """A cloud (N,) that spends a budget exactly, uniformly over the points of `pool` (N,), then over
    the rest.

    As stored in float32, no point goes farther than it may. Intensities are drawn uniformly between the
    lowest and the highest of the clean cloud, which is all that an attack is held to.
    """
    points = xyz(cloud)
    finite = np.asarray(np.isfinite(points).all(axis=1))
    first, rest = pool & finite, ~pool & finite
    removed = _choose(first, rest, budget.removed, rng)
    moved = _choose(first, rest, len(budget.moved_m), rng)
    sources = _choose_again(first, finite, budget.added, rng)
    brightened = _choose(first, rest, budget.intensity_changed, rng)
    moved_m = rng.permutation(budget.moved_m)[: len(moved)]
    new = with_xyz(
        cloud[sources],
        move_within(points[sources], random_offsets(len(sources), budget.reach_m, rng)),
    )
    points[moved] = move_within(points[moved], random_directions(len(moved), rng) * moved_m[:, None])
    changed = with_xyz(cloud, points)
    known = cloud["intensity"][finite & np.isfinite(cloud["intensity"])]
    lowest, highest = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    changed["intensity"][brightened] = rng.uniform(lowest, highest, len(brightened))
    return np.concatenate([np.delete(changed, removed), new])


def _choose(pool: Bool, rest: Bool, count: int, rng: np.random.Generator) -> Int64:
    """`count` different points of the pool, and of the rest what the pool lacks; no more than there are."""
    first, then = np.flatnonzero(pool), np.flatnonzero(rest)
    inside = min(count, len(first))
    outside = min(count - inside, len(then))
    return np.concatenate(
        [rng.choice(first, size=inside, replace=False), rng.choice(then, size=outside, replace=False)]
    ).astype(np.int64)


def _choose_again(pool: Bool, every: Bool, count: int, rng: np.random.Generator) -> Int64:
    """`count` points of the pool, or of all if that is empty; one may be taken more than once."""
    points = np.flatnonzero(pool if pool.any() else every)
    return rng.choice(points, size=count) if len(points) else np.zeros(0, np.int64)
