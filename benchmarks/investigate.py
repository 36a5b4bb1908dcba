"""How well `advpipe investigate` names who lied: its tuning, and its evaluation on other drives.

    python benchmarks/investigate.py record FOLDER      # all drives and attacks; goes on where it stopped
    python benchmarks/investigate.py tune FOLDER        # writes stages/investigate/calibration.json
    python benchmarks/investigate.py evaluate FOLDER [--figure reliability.svg]
    python benchmarks/investigate.py looked-at FOLDER   # false alarms of an hour on the tuning maps

`tune` and `evaluate` make what FOLDER lacks; with --there they use only what is there. `evaluate` prints, of
each attack, how many of the liars were named, how late, and how far off their start is; the same of
coordinated drives; false alarms an hour; an ablation of the cues; and a reliability table. Its marks: the
right culprit in 80 %, a median error of the start of 1 s, 6 false alarms an hour, and real time. All drives
take about an hour and a half of one core, of which two thirds are two hours of clean driving: that of the
evaluation, and one on the tuning maps, of which `looked-at` prints the false alarms.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from common import finish, machine
from investigate_drives import COORDINATED, CuedReading, DriveFolder, TrueLie, cued_readings, true_lies
from investigate_outcome import BagOutcome, culprits, outcome
from investigate_tuning import MOST_LIARS, tuned

from advpipe.pipeline.bag.reader import BagReader
from advpipe.stages.investigate import calibration as calibrations
from advpipe.stages.investigate.calibration import Calibration, shipped_calibration
from advpipe.stages.investigate.registry import CUES
from advpipe.stages.investigate.run import investigate

LEAST: dict[str, float] = {
    "cam-plausibility": 1.1,
    "cam-surroundings": 1.1,
    "cpm-objects": 2.0,
    "free-space": 2.0,
    "power-distance": 5.0,
    "gnss-innovation": 1.0,
    "gnss-motion": 3.0,
    "gnss-lanes": 1.5,
    "lidar-rays": 0.3,
    "lidar-order": 0.5,
    "lidar-density": 2.0,
    "lidar-temporal": 2.5,
    "lidar-tracks": 3.0,
}
"""Limits are never below these: short drives show too little of what honest ones reach."""

PROBABILITIES = (0, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 1.001)

Known = tuple[Sequence[CuedReading], Sequence[TrueLie]]
"""What the cues read in a bag, and who lies in it."""


def known(bags: Iterable[Path]) -> list[Known]:
    """Of each bag."""
    return [(cued_readings(bag), true_lies(bag)) for bag in bags]


def print_by_attack(outcomes: Mapping[str, Sequence[BagOutcome]]) -> None:
    """A line for each attack: liars that were named, of all; precision; latency; error of the start."""
    print("attack                      culprit   named  recall  precision  latency s  start error s  wrongly")
    for attack, bags in outcomes.items():
        lies = [lie for bag in bags for lie in bag.lies]
        named = [lie for lie in lies if lie.is_named]
        wrong = [name for bag in bags for name in bag.wrong]
        right = [is_right for _, is_right, _ in culprits(bags)]
        precision = len(named) / (len(named) + len(wrong)) if named or wrong else np.nan
        recall = len(named) / len(lies) if lies else np.nan
        late, off = (
            np.median([getattr(lie, key) for lie in named]) if named else np.nan
            for key in ("latency_s", "start_error_s")
        )
        print(
            f"{attack:<27} {sum(right):>2} of {len(right):<2}{len(named):>4}/{len(lies):<4}{recall:>6.2f}"
            f"{precision:>11.2f}{late:>11.2f}{off:>15.2f}  " + ", ".join(wrong[:3])
        )


def print_summary(name: str, outcomes: Sequence[BagOutcome]) -> tuple[float, float]:
    """The share of attacks of which a culprit was named, and the median error of the start."""
    found = culprits(outcomes)
    share = float(np.mean([is_right for _, is_right, _ in found])) if found else np.nan
    errors = [lie.start_error_s for bag in outcomes for lie in bag.lies if lie.is_named]
    median = float(np.median(errors)) if errors else np.nan
    wrong = [one for bag in outcomes for one in bag.wrong]
    print(
        f"{name}: the right culprit in {100 * share:.0f} % of {len(found)} attacks, median error of the "
        f"start {median:.2f} s, {len(wrong)} wrongly named in "
        f"{sum(bag.seconds for bag in outcomes):.0f} s of {len(outcomes)} drives"
    )
    return share, median


def reliability(outcomes: Iterable[BagOutcome]) -> list[tuple[float, float, float]]:
    """By range of probability: suspects in windows, their mean probability, and the share that truly lied.

    The liars of a bag count as `MOST_LIARS` together, as in the tuning: a flood invents a thousand ids.
    """
    pairs, worth = [], []
    for one in outcomes:
        liars = sum(lied for _, lied in one.probabilities)
        pairs += one.probabilities
        worth += [min(1.0, MOST_LIARS / liars) if lied else 1.0 for _, lied in one.probabilities]
    value, lied = np.array(pairs, np.float64).reshape(-1, 2).T
    weight, found = np.array(worth), []
    for low, high in pairwise(PROBABILITIES):
        part = (value >= low) & (value < high)
        total = float(weight[part].sum())
        mean, truly = ((weight[part] * of[part]).sum() / total if total else np.nan for of in (value, lied))
        found.append((total, float(mean), float(truly)))
    return found


def print_reliability(rows: Sequence[tuple[float, float, float]]) -> None:
    """How often those to whom a probability was given truly lied, and the expected calibration error."""
    print("probability    suspects    mean   truly")
    for (low, high), (count, mean, truly) in zip(pairwise(PROBABILITIES), rows, strict=True):
        print(f"{low:.2f} to {min(high, 1):.2f} {count:>9.0f}{mean:>8.3f}{truly:>8.3f}")
    all_of_them = sum(count for count, _, _ in rows)
    error = sum(count * abs(mean - truly) for count, mean, truly in rows if count) / max(all_of_them, 1)
    print(f"expected calibration error: {error:.4f}")


def draw_reliability(rows: Sequence[tuple[float, float, float]], path: Path) -> None:
    """The reliability diagram."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4, 4), layout="constrained")
    axes = figure.subplots()
    mean, truly, count = np.array([(m, t, n) for n, m, t in rows if n]).T
    axes.plot([0, 1], [0, 1], color="0.7", lw=1)
    axes.plot(mean, truly, "o-", color="tab:blue", ms=4)
    for x, y, number in zip(mean, truly, count, strict=True):
        axes.annotate(f"{number:.0f}", (x, y), xytext=(5, -9), textcoords="offset points", fontsize=7)
    axes.set(xlabel="probability that it lies", ylabel="share that truly lied", xlim=(0, 1), ylim=(0, 1))
    figure.savefig(path)


def evaluate(folder: DriveFolder, coordinated: int, clean_s: float, figure: Path | None) -> bool:
    """Print all tables; whether the marks are reached."""
    calibration = shipped_calibration()
    print(machine())
    by_attack: dict[str, list[BagOutcome]] = {}
    attacked: list[Known] = []
    for word, bag in folder.tests():
        attacked += known([bag])
        by_attack.setdefault(word, []).append(outcome(*attacked[-1], calibration))
    print_by_attack(by_attack)
    alone = [one for each in by_attack.values() for one in each]
    print_summary("one attack", alone)
    together = known(folder.coordinated(coordinated))
    combined = [outcome(*one, calibration) for one in together]
    share, start_error_s = print_summary("coordinated", combined)
    clean = [outcome(readings, (), calibration) for readings, _ in known(folder.clean_drives(clean_s))]
    alarms_per_h = print_false_alarms(clean)
    print_ablation([*attacked, *together], calibration)
    rows = reliability([*alone, *combined, *clean])
    print_reliability(rows)
    if figure is not None:
        draw_reliability(rows, figure)
    factor = real_time_factor(next(folder.coordinated(coordinated)))
    return share >= 0.8 and start_error_s <= 1 and alarms_per_h <= 6 and factor >= 1


def print_false_alarms(clean: Sequence[BagOutcome]) -> float:
    """Those of clean drives; how many an hour."""
    hours = sum(one.seconds for one in clean) / 3600
    alarms = [name for one in clean for name in one.wrong]
    print(
        f"clean: {len(alarms)} false alarms in {hours:.2f} h, {len(alarms) / hours:.1f} an hour {alarms[:9]}"
    )
    return len(alarms) / hours


def print_ablation(bags: Sequence[Known], calibration: Calibration) -> None:
    """What is lost without each cue."""
    for name in ("", *CUES):
        chosen = calibration.without(name) if name else calibration
        outcomes = [outcome(readings, lies, chosen) for readings, lies in bags]
        lies = [lie for one in outcomes for lie in one.lies]
        right = float(np.mean([is_right for _, is_right, _ in culprits(outcomes)]))
        print(
            f"without {name or 'nothing':<20} culprit {100 * right:5.1f} %, liars named "
            f"{100 * np.mean([lie.is_named for lie in lies]):5.1f} %, wrongly named "
            f"{sum(len(one.wrong) for one in outcomes)}"
        )


def real_time_factor(bag: Path) -> float:
    """How many times faster than the drive an investigation is, in processor time of one core."""
    start_s = time.process_time()
    found = investigate(bag)
    took_s = time.process_time() - start_s
    clouds = sum(info.count for name, info in BagReader(bag).topics.items() if name.endswith("/points"))
    print(
        f"speed: {found.duration_s:.0f} s of drive with {clouds} clouds in {took_s:.1f} s of processor time, "
        f"{found.duration_s / took_s:.1f} times real time"
    )
    return found.duration_s / took_s


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("record", "tune", "evaluate", "looked-at"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--there", action="store_true", help="use only the bags that are there")
    parser.add_argument(
        "--coordinated", type=int, default=COORDINATED, help="drives with three attacks at once"
    )
    parser.add_argument("--clean-s", type=float, default=3600, help="of clean driving")
    parser.add_argument("--out", type=Path, help="where tune writes, instead of the package")
    parser.add_argument(
        "--figure", type=Path, help="where evaluate draws the reliability diagram (.svg, .png)"
    )
    given = parser.parse_args()
    folder = DriveFolder(given.folder, makes=not given.there)
    if given.what == "record":
        for each in (folder.tuning(), folder.coordinated(given.coordinated), folder.tests()):
            for bag in each:
                print(bag, flush=True)
        print(*folder.clean_drives(given.clean_s), *folder.looked_at(), sep="\n")
    elif given.what == "tune":
        bags = list(folder.tuning())
        drives = tuple(dict.fromkeys(bag.parent.name for bag in bags))
        found = replace(tuned(known(bags), LEAST), drives=drives)
        path = given.out or Path(calibrations.__file__).with_name(calibrations.FILE)
        path.write_text(found.text(), encoding="utf-8")
        print(json.dumps(found.to_plain(), indent=1))
    elif given.what == "looked-at":
        calibration = shipped_calibration()
        print_false_alarms([outcome(read, (), calibration) for read, _ in known(folder.looked_at())])
    else:
        finish(evaluate(folder, given.coordinated, given.clean_s, given.figure))


if __name__ == "__main__":
    main()
