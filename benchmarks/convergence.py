"""Shows whether attacks on clouds have converged: what half, once and twice their steps leave.

    python benchmarks/convergence.py BAG --out FOLDER [--frames 60] [--factors 0.5 1 2] [--seed 0]
                                     [--budgets perturb-10 perturb-3 ...]

BAG is a clean drive. For each budget and number of steps, on the same clouds: the attacker's own objective
(its mean success on an object, higher is better), the mAP ratio at strict and at loose overlap, and by how
much the ratios differ from those of the line before, with the 95 % interval of the paired difference over
frames. The mark: twice the steps change the strict ratio by less than 2 points at the interval's upper end.

Attacked clouds' detections are kept in FOLDER, a file each: a run that was stopped goes on. The objective
over steps is drawn to FOLDER/objective.png.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt
from common import finish, machine

from advpipe.pipeline.adversary.goal import goal_of
from advpipe.pipeline.bag.frames import Frame, FrameSlice, count_frames, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.campaigns.sweep.budgets import AXES, SweepBudget, budget_named
from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.metrics.average_precision import RankedMatches, mean_average_precision
from advpipe.pipeline.metrics.matching import FrameMatches
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.evaluate.detection.scoring import ground_truth, known_classes, match

Float64 = npt.NDArray[np.float64]

KINDS = ("strict", "loose")
MOST_POINTS = 2.0
ENOUGH_BOXES = 50
DRAWS = 1000
BUDGETS = ("perturb-10", "perturb-3", "detach-1", "detach-0.3", "attach-0.5", "attach-0.1")


@dataclass(frozen=True)
class Outcome:
    """What an attack leaves in one cloud."""

    found: Detections
    objective: float

    def save(self, path: Path) -> None:

        stream = BytesIO()
        found = self.found
        np.savez(
            stream, boxes=found.boxes, scores=found.scores, labels=found.labels, objective=self.objective
        )
        write_atomically(path, stream.getvalue())

    @classmethod
    def load(cls, path: Path) -> Outcome:
        with np.load(path) as stored:
            found = Detections(stored["boxes"], stored["scores"], stored["labels"])
            return cls(found, float(stored["objective"]))


@dataclass(frozen=True)
class Trial:
    """Attacks on the clouds of a drive by one detector, whose outcomes are kept in a folder."""

    bag: Path
    frames: FrameSlice
    folder: Path
    seed: int

    def outcomes(self, budget: SweepBudget, factor: float) -> list[Outcome]:
        """Of each cloud; factor 0 stands for the clean clouds."""
        attack = None if factor == 0 else attack_of(budget, factor)
        return [self._outcome(frame, budget, factor, attack) for frame in self.read()]

    def read(self) -> Iterator[Frame]:
        return read_frames(self.bag, self.frames)

    def _outcome(
        self, frame: Frame, budget: SweepBudget, factor: float, attack: LidarAttack | None
    ) -> Outcome:
        name = f"{budget.name}x{factor:g}-{self.seed}" if attack else "clean"
        path = self.folder / f"{name}-{frame.index}.npz"
        if path.is_file():
            return Outcome.load(path)
        detector = load_detector("small")
        cloud = frame.cloud
        if attack:
            rng = named_generator(self.seed, "convergence", budget.name, frame.index)
            cloud = attack(cloud, frame.boxes, detector, rng).cloud
        constraints = (attack or attack_of(budget, 1)).constraints
        goal, found = goal_of(constraints, detector, frame.cloud, frame.boxes), detector.detect(cloud)
        success = goal.success(found)
        made = Outcome(found, float(success.mean()) if len(success) else 0.0)
        made.save(path)
        return made


def attack_of(budget: SweepBudget, factor: float) -> LidarAttack:
    """The attack of a budget with so many times its usual steps."""
    steps = AXES[budget.attack].steps
    usual = getattr(_built(budget, {}), steps)
    return _built(budget, {steps: max(1, round(factor * usual))})


def _built(budget: SweepBudget, more: dict[str, int]) -> LidarAttack:
    return build_lidar_attack(
        attack_spec({"type": budget.attack, "recipe": "best", "parameters": {**budget.parameters, **more}})
    )


def ratios_of(trial: Trial, outcomes: Sequence[Outcome], clean: Sequence[Outcome]) -> dict[str, Float64]:
    """The mAP ratio in percent, strict and loose: of all frames, and of each bootstrap draw over frames."""
    detector = load_detector("small")
    classes = known_classes(detector)
    truth = [ground_truth(frame, classes, detector.range_m) for frame in trial.read()]
    rng = named_generator(0, "convergence", "bootstrap")
    weights = [np.ones(len(truth), np.int64)]
    weights += [rng.multinomial(len(truth), [1 / len(truth)] * len(truth)) for _ in range(DRAWS)]
    found: dict[tuple[bool, str], Float64] = {}
    for is_clean, which in ((False, outcomes), (True, clean)):
        matches: dict[tuple[str, str], list[FrameMatches]] = {}
        for of_truth, outcome in zip(truth, which, strict=True):
            for key, each in match(of_truth, outcome.found, classes, KINDS).items():
                matches.setdefault(key, []).append(each)
        boxes = {name: sum(each.n_truth for each in matches["strict", name]) for name in classes}
        enough = [name for name in classes if boxes[name] >= ENOUGH_BOXES] or list(classes)
        for kind in KINDS:
            ranked = [RankedMatches.of(matches[kind, name]) for name in enough]
            means = [
                mean_average_precision(np.array([r.average_precision(w) for r in ranked])) for w in weights
            ]
            found[is_clean, kind] = np.array(means, np.float64)
    return {kind: 100 * found[False, kind] / found[True, kind] for kind in KINDS}


def report(trial: Trial, budget: SweepBudget, factors: Sequence[float]) -> tuple[bool, dict[float, float]]:
    """Print a line a number of steps; whether the last doubling changes little, and the objectives."""
    clean, before = trial.outcomes(budget, 0), None
    objective = {0.0: float(np.mean([each.objective for each in clean]))}
    passed = True
    for factor in factors:
        outcomes = trial.outcomes(budget, factor)
        objective[factor] = float(np.mean([each.objective for each in outcomes]))
        ratios = ratios_of(trial, outcomes, clean)
        line = f"{budget.name:<12} steps x {factor:<4g} objective {objective[factor]:+.4f}"
        for kind in KINDS:
            line += f"  {kind} ratio {ratios[kind][0]:6.2f} %"
            if before is not None:
                change = ratios[kind] - before[kind]
                low, high = np.nanpercentile(change[1:], [2.5, 97.5])
                line += f" (change {change[0]:+.2f}, {low:+.2f}…{high:+.2f})"
                if kind == "strict" and factor == max(factors):
                    passed = -low < MOST_POINTS
                    line += f" mark {MOST_POINTS:g} {'ok' if passed else 'ABOVE'}"
        print(line, flush=True)
        before = ratios
    return passed, objective


def draw(objectives: dict[str, dict[float, float]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.4), dpi=110, layout="constrained")
    axes = figure.subplots()
    for name, objective in objectives.items():
        axes.plot(list(objective), list(objective.values()), marker="o", label=name)
    axes.set_xlabel("steps, in units of the usual number")
    axes.set_ylabel("attacker's objective: mean success on an object")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("bag", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--factors", type=float, nargs="+", default=[0.5, 1, 2])
    parser.add_argument("--budgets", nargs="+", default=list(BUDGETS))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    bag = resolve_bag(given.bag)
    count = count_frames(bag)
    if not 0 < given.frames <= count:
        sys.exit(f"--frames is {given.frames}, but {bag} has {count} clouds")
    step = count // given.frames
    frames = FrameSlice(step // 2, step // 2 + step * given.frames, step)
    given.out.mkdir(parents=True, exist_ok=True)
    trial = Trial(bag, frames, given.out, given.seed)
    print(f"{machine()}; {given.frames} clouds of {bag.parent.name}, seed {given.seed}", flush=True)
    passed, objectives = True, {}
    with fixed_torch_threads():
        for name in given.budgets:
            good, objectives[name] = report(trial, budget_named(name), sorted(given.factors))
            passed &= good
    draw(objectives, given.out / "objective.png")
    finish(passed)


if __name__ == "__main__":
    main()
