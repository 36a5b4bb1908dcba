"""Random baselines of an attacked cloud: the same budget spent randomly.

The one to beat is `random_best`, which is recipe `random-best` of the attacks: it judges as many tries, and
chooses among them and allocates the budget as the attack does. The others are one draw each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.constraints import Constraints
from advpipe.pipeline.adversary.random_best import RandomBudget, random_best
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.baselines import points_near_boxes
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.results.row import RANDOM_BEST
from advpipe.stages.evaluate.detection.random_change import SpentBudget, random_change

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Baseline:
    """A way to spend a budget in one random draw.

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
"""The suffix of baselines in reports of versions before `random_best`: the best of several whole draws."""


def baseline_title(name: str, tries: int = 0) -> str:
    """Such as `randomly near objects`; with its tries such as `random-best, 13 tries`."""
    if name == RANDOM_BEST:
        title = "random-best"
        return f"{title}, {tries} {'try' if tries == 1 else 'tries'}" if tries else title
    title = BASELINES[name.removesuffix(BEST)].title
    return f"{title}, best try" if name.endswith(BEST) else title


def baseline_names() -> list[str]:
    """All names of baselines, in the order of reports."""
    return [RANDOM_BEST, *BASELINES]


def attack_query_budget(provenance: Provenance) -> int:
    """How many tries `random_best` judges: as many as recipe best of the attack, by the record of its bag."""
    return provenance.fields.baseline_tries or provenance.fields.looks or DEFAULT_QUERY_BUDGET


def attack_constraints(provenance: Provenance) -> Constraints:
    """The constraints among the attack's parameters; none where a user's own mean something else."""
    try:
        return Constraints.among({**provenance.parameters, "recipe": provenance.get("recipe")})
    except (AdvpipeError, TypeError, ValueError):
        return Constraints()


@dataclass(frozen=True)
class RandomBaselines:
    """The baselines of one adversarial bag.

    detector: it chooses among the tries. tries: of `random_best`. seed: `random_best` draws as recipe
    `random-best` of the attack does with this seed. drawn: the clouds of `random_best` of a frame that were
    made before, by what they depend on.
    """

    provenance: Provenance
    detector: ObjectDetector
    tries: int
    seed: int
    drawn: dict[Any, Cloud] = field(default_factory=dict)

    def clouds(
        self, clean: Cloud, boxes: Boxes, evaluated: Float64, budget: SpentBudget, index: int
    ) -> Iterator[tuple[str, Cloud]]:
        """The cloud of each baseline of frame `index`, by name.

        boxes: all true ones, which the attack knows. evaluated: (M, 7) those that count.
        """
        yield RANDOM_BEST, self._random_best(clean, boxes, budget, index)
        for name, baseline in BASELINES.items():
            plain = baseline.budget(budget, clean)
            if plain is None:
                continue
            rng = named_generator(self.seed, "evaluate", name, index)
            pool = points_near_boxes(clean, evaluated) if baseline.is_near else np.ones(len(clean), bool)
            yield name, random_change(clean, plain, pool, rng)

    def _random_best(self, clean: Cloud, boxes: Boxes, budget: SpentBudget, index: int) -> Cloud:
        attack = self.provenance.get("attack", "")
        rng = named_generator(self.seed, "attack", attack, "random-best", index)
        spent = RandomBudget(
            budget.removed,
            budget.added,
            budget.reach_m,
            budget.bound_m if len(budget.moved_m) else 0.0,
            bool(budget.intensity_changed),
        )
        constraints = attack_constraints(self.provenance)
        key = attack, spent, repr(constraints), self.tries  # a user's own attack may have lists among them
        if key not in self.drawn:
            self.drawn[key] = random_best(
                clean, boxes, self.detector, constraints, spent, tries=self.tries, rng=rng
            )
        return self.drawn[key]
