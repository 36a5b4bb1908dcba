"""The strength of black-box attacks over their queries.

    python benchmarks/queries.py BAG --out FOLDER [--detector small] [--frames 30] [--queries 25 50 100 200]
                                 [--attacks perturb-10 detach-1 attach-0.5] [--seed 0]

BAG is a clean drive. For each budget and number of queries, on the same clouds: the mAP ratio in percent that
`score-based` and `decision-based` leave, strict and loose, and in brackets its difference to `random-best`,
which judges as many tries and takes its objects from the detections as well, with the 95 % interval of the
paired difference over frames.

Everything is printed as Markdown, and drawn to FOLDER/queries.png. Detections are kept in FOLDER: a run that
was stopped goes on. A query takes about as long as a detection, some 0.1 to 0.3 s of one core: with the
defaults 3 recipes of 375 queries on 3 budgets, 5 to 15 minutes for each frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from attacked_clouds import KINDS, AttackedClouds, attack_with, frames_of, with_interval
from common import machine
from transfer import BUDGETS, identified

from advpipe.pipeline.adversary.constraints import BLACK_BOX
from advpipe.pipeline.adversary.greedy_allocation import MAX_REVISIONS
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.campaigns.sweep.budgets import AXES, SweepBudget, budget_named
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.threads import fixed_torch_threads

Float64 = npt.NDArray[np.float64]

TO_BEAT = "random-best"
LEAST_QUERIES = MAX_REVISIONS + 1


def ratios_at(budget: SweepBudget, clouds: AttackedClouds, recipe: str, queries: int) -> dict[str, Float64]:
    """The ratios of a recipe that judges so many clouds, by the kind of overlap."""
    more: dict[str, object] = {"queries": queries}
    if recipe == TO_BEAT:
        steps = AXES[budget.attack].steps
        more = {"truth": "detections", steps: queries if steps == "steps" else queries - MAX_REVISIONS}
    attack = attack_with(budget.attack, recipe, {**budget.parameters, **more})
    assert attack.query_budget == queries
    ((name, victim),) = clouds.evaluated.items()
    return clouds.ratios(f"{budget.name}-{recipe}-{queries}", attack, victim)[name]


def report(budget: SweepBudget, clouds: AttackedClouds, counts: Sequence[int]) -> dict[str, list[float]]:
    """Print the table of a budget; the strict ratios of each recipe."""
    print(f"\n### {budget.attack}, {budget.title}\n")
    print(f"| recipe | overlap | {' | '.join(f'{count} queries' for count in counts)} |")
    print("|---" * (len(counts) + 2) + "|", flush=True)
    strict: dict[str, list[float]] = {}
    for recipe in (TO_BEAT, *BLACK_BOX):
        mine = [ratios_at(budget, clouds, recipe, count) for count in counts]
        strict[recipe] = [float(each["strict"][0]) for each in mine]
        for kind in KINDS:
            texts = []
            for count, each in zip(counts, mine, strict=True):
                change = each[kind] - ratios_at(budget, clouds, TO_BEAT, count)[kind]
                beside = "" if recipe == TO_BEAT else f" ({with_interval(change, '+')})"
                texts.append(f"{each[kind][0]:.1f}{beside}")
            print(f"| {recipe} | {kind} | {' | '.join(texts)} |", flush=True)
    return strict


def draw(curves: dict[str, dict[str, list[float]]], counts: Sequence[int], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4 * len(curves), 3.6), dpi=110, layout="constrained")
    for place, (name, strict) in enumerate(curves.items()):
        axes = figure.add_subplot(1, len(curves), place + 1)
        for recipe, values in strict.items():
            axes.plot(counts, values, marker="o", label=recipe)
        axes.set(
            xscale="log", xlabel="queries a cloud", ylabel="strict mAP ratio in %", title=name, ylim=(0, 105)
        )
        axes.minorticks_off()
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.grid(alpha=0.3)
        axes.legend()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bag", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--detector", default="small")
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--queries", type=int, nargs="+", default=[25, 50, 100, 200])
    parser.add_argument("--attacks", nargs="+", default=list(BUDGETS), help="budgets, such as detach-1")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default=CPU)
    given = parser.parse_args()
    if min(given.queries) < LEAST_QUERIES:
        parser.error(f"--queries: give {LEAST_QUERIES} or more")
    try:
        bag = resolve_bag(given.bag)
        budgets = [budget_named(name) for name in given.attacks]
        detector = identified([given.detector], given.device)
        frames = frames_of(bag, given.frames)
    except AdvpipeError as error:
        parser.error(str(error))
    given.out.mkdir(parents=True, exist_ok=True)
    print(f"{machine()}; {len(frames)} clouds of {bag.parent.name}, seed {given.seed}", flush=True)
    clouds = AttackedClouds(given.out, frames, detector, given.seed)
    with fixed_torch_threads():
        curves = {each.name: report(each, clouds, given.queries) for each in budgets}
    draw(curves, given.queries, given.out / "queries.png")


if __name__ == "__main__":
    main()
