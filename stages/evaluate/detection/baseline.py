"""Random baselines of an attacked cloud: the same budget spent by chance, and the best of several tries."""

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
    """A way to spend a budget by chance.

    is_near: on points near objects first, else anywhere. is_full: every point moves as far as the attack was
    allowed to move any, however few it did move; and every one gets another intensity if any did.
    """

    title: str
    is_near: bool = False
    is_full: bool = False

    def budget(self, budget: SpentBudget, clean: Cloud) -> SpentBudget | None:
        """What this baseline spends; None where it would be another one over again."""
        if not self.is_full:
            return budget
        if budget.removed or budget.added:
            return None
        finite = int(np.isfinite(xyz(clean)).all(axis=1).sum())
        moved = finite if len(budget.moved_m) else 0
        intensity_changed = finite if budget.intensity_changed else 0
        return replace(budget, moved_m=np.full(moved, budget.bound_m), intensity_changed=intensity_changed)


BASELINES = {
    "baseline": Baseline("at random anywhere"),
    "baseline_near": Baseline("at random near objects", is_near=True),
    "baseline_full": Baseline("at random, every point", is_full=True),
}

USUAL_LOOKS = 24
"""How often an attack looks that does not say: as often as any of ours."""


BEST = "_best"
"""What the word of a baseline ends with that is the best of several tries."""


def baseline_title(word: str) -> str:
    """Such as `at random near objects, best try`."""
    title = BASELINES[word.removesuffix(BEST)].title
    return f"{title}, best try" if word.endswith(BEST) else title


def baseline_words() -> list[str]:
    """All words of baselines, in the order of reports."""
    return [word + end for word in BASELINES for end in ("", BEST)]


def attack_query_budget(provenance: Provenance) -> int:
    """To how many tries the attack looked to keep the best, by the record of its bag."""
    return provenance.fields.looks or USUAL_LOOKS


def random_baselines(
    clean: Cloud,
    boxes: Float64,
    budget: SpentBudget,
    worth: Callable[[Cloud], Float64],
    *,
    tries: int,
    seed: int,
    index: int,
) -> Iterator[tuple[str, Cloud]]:
    """The clouds of every baseline of frame `index`, by word; with more than one try, also the best ones.

    boxes: (M, 7) of the objects to hide. worth: of each object (M,) in a cloud, what the detector sees of
    it; the best try is chosen for each object by the detector's own result, as attacks do, and put together;
    unless one try as a whole is better.
    """
    for word, baseline in BASELINES.items():
        spent = baseline.budget(budget, clean)
        if spent is None:
            continue
        rng = named_generator(seed, "evaluate", word, index)
        pool = points_near_boxes(clean, boxes) if baseline.is_near else np.ones(len(clean), dtype=bool)
        random = RandomChange(clean, boxes, spent, pool, rng)
        first = random.draw()
        yield word, random.apply(first)
        if tries > 1:
            yield word + BEST, _best(random, [first, *(random.draw() for _ in range(tries - 1))], worth)


def _best(random: RandomChange, tries: list[DrawnChange], worth: Callable[[Cloud], Float64]) -> Cloud:
    worths = np.stack([worth(random.apply(each)) for each in tries])  # (tries, M)
    if not worths.size:
        return random.apply(tries[0])
    together = random.apply(random.together(tries, np.argmin(worths, axis=0)))
    alone = int(np.argmin(worths.sum(axis=1)))
    if worths[alone].sum() < worth(together).sum():
        return random.apply(tries[alone])
    return together
