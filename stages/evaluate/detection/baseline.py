"""Random baselines of an attacked cloud: the same budget spent randomly, and the best of several draws."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.baselines import points_near_boxes
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.stages.evaluate.detection.random_change import DrawnChange, RandomChange, SpentBudget

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Baseline:
    """A way to spend a budget randomly.

    is_near: on points near objects first, else anywhere. is_full: every point moves as far as the attack was
    allowed to move any, however few it did move; and every one gets another intensity if any did.
    """

    title: str
    is_near: bool = False
    is_full: bool = False

    def budget(self, budget: SpentBudget, clean: Cloud) -> SpentBudget | None:
        """What this baseline spends; None where it would repeat another baseline."""
        if not self.is_full:
            return budget
        if budget.removed or budget.added:
            return None
        finite = int(np.isfinite(xyz(clean)).all(axis=1).sum())
        moved = finite if len(budget.moved_m) else 0
        intensity_changed = finite if budget.intensity_changed else 0
        return replace(budget, moved_m=np.full(moved, budget.bound_m), intensity_changed=intensity_changed)


BASELINES = {
    "baseline": Baseline("randomly anywhere"),
    "baseline_near": Baseline("randomly near objects", is_near=True),
    "baseline_full": Baseline("randomly, every point", is_full=True),
}

DEFAULT_QUERY_BUDGET = 24
"""The query budget assumed for an attack that records none: the largest of ours."""


BEST = "_best"
"""The suffix of the names of baselines that are the best of several draws."""


def baseline_title(name: str) -> str:
    """Such as `randomly near objects, best try`."""
    title = BASELINES[name.removesuffix(BEST)].title
    return f"{title}, best try" if name.endswith(BEST) else title


def baseline_names() -> list[str]:
    """All names of baselines, in the order of reports."""
    return [name + end for name in BASELINES for end in ("", BEST)]


def attack_query_budget(provenance: Provenance) -> int:
    """How many detector queries the attack used to keep the best try, by the record of its bag."""
    return provenance.fields.looks or DEFAULT_QUERY_BUDGET


def random_baselines(
    clean: Cloud,
    boxes: Float64,
    budget: SpentBudget,
    worth: Callable[[Cloud], Float64],
    *,
    n_draws: int,
    seed: int,
    index: int,
) -> Iterator[tuple[str, Cloud]]:
    """The clouds of every baseline of frame `index`, by name; with more than one draw, also the best of them.

    boxes: (M, 7) of the objects to hide. worth: of each object (M,) in a cloud, what the detector sees of
    it; the best draw is chosen for each object by the detector's own result, as attacks do, and put together;
    unless one draw as a whole is better.
    """
    for name, baseline in BASELINES.items():
        spent = baseline.budget(budget, clean)
        if spent is None:
            continue
        rng = named_generator(seed, "evaluate", name, index)
        pool = points_near_boxes(clean, boxes) if baseline.is_near else np.ones(len(clean), dtype=bool)
        random = RandomChange(clean, boxes, spent, pool, rng)
        first = random.draw()
        yield name, random.apply(first)
        if n_draws > 1:
            yield name + BEST, _best(random, [first, *(random.draw() for _ in range(n_draws - 1))], worth)


def _best(random: RandomChange, draws: list[DrawnChange], worth: Callable[[Cloud], Float64]) -> Cloud:
    worths = np.stack([worth(random.apply(each)) for each in draws])  # (draws, M)
    if not worths.size:
        return random.apply(draws[0])
    together = random.apply(random.together(draws, np.argmin(worths, axis=0)))
    alone = int(np.argmin(worths.sum(axis=1)))
    if worths[alone].sum() < worth(together).sum():
        return random.apply(draws[alone])
    return together
