"""Finished cells of a sweep, computed again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from advpipe.pipeline.campaigns.sweep.bench import Bench
from advpipe.pipeline.campaigns.sweep.budgets import SweepBudget
from advpipe.pipeline.campaigns.sweep.compare import cell_differences
from advpipe.pipeline.campaigns.sweep.settings import refuse_other_work, with_this_code
from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.core.verbosity import print_result


def check_cells(
    bench: Bench, store: Store, places: Sequence[tuple[str, SweepBudget]], count: int, seed: int
) -> list[str]:
    """Compute some of the stored cells again with their settings; raises AdvpipeError if one differs.

    The current code computes them: equal figures show that changes of the code did not change them.
    """

    stored = [(cell, budget) for recipe, budget in places if (cell := store.load(recipe, budget.name))]
    if not stored:
        raise UsageError(f"{store.folder} holds none of these cells; run the sweep first")
    drawn = named_generator(seed, "sweep", "check").permutation(len(stored))[:count]
    again = replace(bench, out=store.folder / "check", keep_bags=False)
    wrong: list[str] = []
    checked: list[str] = []
    for cell, budget in (stored[place] for place in sorted(drawn)):
        refuse_other_work(cell, bench.clean, bench.detector, bench.device)
        now = with_this_code(cell.settings)
        ((computed, _),) = again.run(budget, [cell.recipe], now)
        found = cell_differences(cell, computed)
        same = "the same" if now == cell.settings else "the same, though other code of advpipe made it"
        print_result(f"{cell.name}: {'; '.join(found[:5]) or same}")
        checked.append(cell.name)
        wrong += [cell.name] if found else []
    again.tidy(again.out)
    if wrong:
        raise AdvpipeError(f"computed again, {', '.join(wrong)} differ from what {store.folder} holds")
    return checked
