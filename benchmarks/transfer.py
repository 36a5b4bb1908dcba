"""Transfer between detectors: attacks against one, or an ensemble, and what they leave of the others.

    python benchmarks/transfer.py BAG --detectors A B C --out FOLDER [--frames 30] [--seed 0]
                                  [--attacks perturb-10 detach-1 attach-0.5]
                                  [--recipes best hide transfer ensemble ensemble-transfer]

BAG is a clean drive; A, B and C are names or checkpoints. Rows are the attacked detectors, columns the
evaluated ones; a star marks those that were attacked. The recipes that begin with `ensemble` attack, for each
detector, all others at once, by `best` or by `transfer`. `random-best` attacks the same row and judges as
many tries as `best`, and has rows of its own: each cell shows the mAP ratio in percent and in brackets its
difference to that of `random-best`, with the 95 % interval of the paired difference over frames, at strict
and at loose overlap. Then, on detectors that were not attacked: what recipe `transfer` and ensembles bring
against the plain `best`, in the mean over rows. The marks: these differences lie below 0 with their whole
interval. Last, what each ensemble brings on the detector that it leaves out, against the better of two
attacks, each on one of its members.

Everything is printed as Markdown. Detections are kept in FOLDER, a file for each cloud: a run that was
stopped goes on. With three detectors there are 21 attacks on each cloud and budget, of some 5 to 60 s of one
core: 30 frames at three budgets take about a day of one core. Parts of it, by --attacks or --recipes, may run
side by side in the same folder. --device cuda computes one cloud at a time, too.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from attacked_clouds import KINDS, AttackedClouds, attack_with, frames_of, with_interval
from common import finish, machine

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.campaigns.sweep.budgets import SweepBudget, budget_named
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.ensemble import ensemble_of
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.registry import detector_sha256, detector_slug, load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads

Float64 = npt.NDArray[np.float64]
Cell = Mapping[str, Float64]
"""mAP ratios by kind of overlap, each with its draws."""

BUDGETS = ("perturb-10", "detach-1", "attach-0.5")
RECIPES = ("best", "hide", "transfer", "ensemble", "ensemble-transfer")
ENSEMBLE = "ensemble"
TO_BEAT = "random-best"


@dataclass(frozen=True)
class Row:
    """An attack on one detector, or on several at once: their names."""

    recipe: str
    attacked: tuple[str, ...]

    @property
    def title(self) -> str:
        return " + ".join(each.partition("@")[0] for each in self.attacked)

    @property
    def plain_recipe(self) -> str:
        """The recipe of the attack."""
        return self.recipe.removeprefix(ENSEMBLE).removeprefix("-") or "best"


def rows_of(recipes: Sequence[str], names: Sequence[str]) -> list[Row]:
    """The attacks of the recipes; an ensemble is of all detectors but one."""
    rows = []
    for recipe in recipes:
        if recipe.startswith(ENSEMBLE):
            rows += [Row(recipe, tuple(other for other in names if other != name)) for name in names]
        else:
            rows += [Row(recipe, (name,)) for name in names]
    return rows


@dataclass(frozen=True)
class Matrix:
    """The ratios of one budget."""

    budget: SweepBudget
    clouds: AttackedClouds

    def cells(self, row: Row) -> Mapping[str, Cell]:
        """By the evaluated detector."""
        members = [self.clouds.evaluated[name] for name in row.attacked]
        victim = ensemble_of(members) if len(members) > 1 else members[0]
        attack = attack_with(self.budget.attack, row.plain_recipe, self.budget.parameters)
        key = f"{self.budget.name}-{row.plain_recipe}-{'+'.join(row.attacked)}"
        return self.clouds.ratios(key, attack, victim)

    def lines(self, rows: Sequence[Row]) -> Iterator[str]:
        """The table of strict and loose ratios, a line as soon as it is known."""
        names = list(self.clouds.evaluated)
        heads = [f"{name.partition('@')[0]}, {kind}" for name in names for kind in KINDS]
        yield f"| recipe | attacked | {' | '.join(heads)} |"
        yield "|---" * (len(heads) + 2) + "|"
        for row in [*rows, *dict.fromkeys(Row(TO_BEAT, row.attacked) for row in rows)]:
            mine, random = self.cells(row), self.cells(Row(TO_BEAT, row.attacked))
            texts = []
            for name in names:
                for kind in KINDS:
                    text = f"{mine[name][kind][0]:.1f}{'*' if name in row.attacked else ''}"
                    change = with_interval(mine[name][kind] - random[name][kind], "+")
                    texts.append(text if row.recipe == TO_BEAT else f"{text} ({change})")
            yield f"| {row.recipe} | {row.title} | {' | '.join(texts)} |"

    def lines_of_ensembles(self, recipe: str) -> Iterator[str]:
        """The table of what ensembles leave of the third detector, and of the difference to the better of two
        attacks, each on one member."""
        head = "| {} | better member | difference "
        yield f"| attacked | evaluated {head.format('strict')}{head.format('loose')}|"
        yield "|---" * 8 + "|"
        for row in rows_of([recipe], list(self.clouds.evaluated)):
            (third,) = set(self.clouds.evaluated) - set(row.attacked)
            texts = []
            for kind in KINDS:
                together = self.cells(row)[third][kind]
                alone = [self.cells(Row(row.plain_recipe, (name,)))[third][kind] for name in row.attacked]
                better = min(alone, key=lambda ratios: float(ratios[0]))
                texts += [f"{together[0]:.1f}", f"{better[0]:.1f}", with_interval(together - better, "+")]
            yield f"| {row.title} | {third.partition('@')[0]} | {' | '.join(texts)} |"

    def unseen(self, recipe: str, kind: str) -> Float64:
        """The mean ratio of a recipe on the detectors that it did not attack."""
        names = list(self.clouds.evaluated)
        values = [
            self.cells(row)[name][kind]
            for row in rows_of([recipe], names)
            for name in names
            if name not in row.attacked
        ]
        mean: Float64 = np.mean(values, axis=0)
        return mean


def report(matrix: Matrix, recipes: Sequence[str]) -> bool:
    """Print the tables of a budget; whether all that is to transfer better does so beyond the interval."""
    print(f"\n### {matrix.budget.attack}, {matrix.budget.title}\n", flush=True)
    for line in matrix.lines(rows_of(recipes, list(matrix.clouds.evaluated))):
        print(line, flush=True)
    print("\nOn detectors that were not attacked, in the mean:\n")
    print("| recipe | strict | to `best` | to `random-best` | loose | to `best` | to `random-best` |")
    print("|---" * 7 + "|")
    passed = True
    for recipe in dict.fromkeys(("best", *recipes, TO_BEAT)):
        texts = []
        for kind in KINDS:
            mine = matrix.unseen(recipe, kind)
            texts.append(f"{mine[0]:.1f}")
            for other in ("best", TO_BEAT):
                change = mine - matrix.unseen(other, kind)
                texts.append("" if recipe == other else with_interval(change, "+"))
                is_asked = kind == "strict" and other == "best" and recipe not in ("best", "hide", TO_BEAT)
                passed &= not is_asked or float(np.nanpercentile(change[1:], 97.5)) < 0
        print(f"| {recipe} | {' | '.join(texts)} |", flush=True)
    for recipe in recipes:
        if recipe.startswith(ENSEMBLE):
            print(f"\n{recipe.capitalize()}s, on the detector left out:\n")
            for line in matrix.lines_of_ensembles(recipe):
                print(line, flush=True)
    return passed


def identified(names: Sequence[str], device: str) -> dict[str, ObjectDetector]:
    """The detectors by their names and the beginnings of their checksums."""
    return {
        f"{detector_slug(name)}@{detector_sha256(name)[:8]}": load_detector(name, device) for name in names
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bag", type=Path)
    parser.add_argument("--detectors", nargs="+", required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--attacks", nargs="+", default=list(BUDGETS), help="budgets, such as detach-1")
    parser.add_argument("--recipes", nargs="+", default=list(RECIPES), choices=RECIPES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default=CPU)
    given = parser.parse_args()
    if len(given.detectors) < 3 and any(each.startswith(ENSEMBLE) for each in given.recipes):
        parser.error("an ensemble of all detectors but one takes three or more; give more, or other recipes")
    if len(given.detectors) < 2:
        parser.error("give two detectors or more")
    try:
        bag = resolve_bag(given.bag)
        budgets = [budget_named(name) for name in given.attacks]
        detectors = identified(given.detectors, given.device)
        frames = frames_of(bag, given.frames)
    except AdvpipeError as error:
        parser.error(str(error))
    given.out.mkdir(parents=True, exist_ok=True)
    print(f"{machine()}; {len(frames)} clouds of {bag.parent.name}, seed {given.seed}", flush=True)
    clouds = AttackedClouds(given.out, frames, detectors, given.seed)
    with fixed_torch_threads():
        clean = [
            f"{name.partition('@')[0]} {each['strict'][0]:.3f}, {each['loose'][0]:.3f}"
            for name, each in clouds.clean.items()
        ]
        print(f"clean mAP, strict and loose: {'; '.join(clean)}", flush=True)
        passed = [report(Matrix(budget, clouds), given.recipes) for budget in budgets]
    finish(all(passed))


if __name__ == "__main__":
    main()
