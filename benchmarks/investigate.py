"""How well `advpipe investigate` names who lied: its tuning, and its evaluation on other drives.

    python benchmarks/investigate.py tune FOLDER        # records and attacks, 25 min on two cores; then 1 min
    python benchmarks/investigate.py evaluate FOLDER    # as long; coordinated 20 min; clean 1 h

Both record what FOLDER lacks. `tune` writes `stages/investigate/calibration.json`. `evaluate` prints, of each
attack, how many lies were named, how late, and how far off their start is; the same of coordinated drives;
false alarms an hour; an ablation of the cues; and a reliability table. Its marks: the right culprit in 80 %,
a median error of the start of 1 s, 6 false alarms an hour, and real time.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from common import finish, machine
from investigate_drives import (
    ATTACKS,
    MORE,
    TESTS,
    TUNING,
    CuedReading,
    TrueLie,
    attacked,
    clean_sites,
    coordinated_sites,
    cued_readings,
    recorded,
    together,
    true_lies,
)

from advpipe.pipeline.bag.reader import BagReader
from advpipe.stages.investigate import calibration as calibrations
from advpipe.stages.investigate.calibration import Calibration, CueCalibration, shipped_calibration
from advpipe.stages.investigate.cue import GNSS, Suspect
from advpipe.stages.investigate.registry import CUES
from advpipe.stages.investigate.run import RELYING, investigate
from advpipe.stages.investigate.suspicion import CumulativeSuspicion, SuspectRecord

LEAST: Mapping[str, float] = {
    "cam-plausibility": 1.2,
    "cam-surroundings": 1.2,
    "cpm-objects": 2.5,
    "free-space": 2.5,
    "power-distance": 6.0,
    "gnss-innovation": 1.0,
    "gnss-motion": 3.5,
    "gnss-lanes": 1.5,
    "lidar-rays": 0.3,
    "lidar-order": 0.5,
    "lidar-density": 3.0,
}
"""Limits are never below these: short drives show too little of what honest ones reach."""

CLEAN_QUANTILE, MARGIN = 0.99, 1.15
RIDGE = 0.02
SLACK_NS = 2_000_000_000
"""An alarm that ends so long after a lie still belongs to it."""


def tune(folder: Path) -> Calibration:
    """Limits from clean drives; weights by logistic regression on the suspects of all drives."""
    clean = [(cued_readings(recorded(folder, site)), set[Suspect]()) for site in TUNING]
    bags = [
        (cued_readings(bag), {lie.suspect for lie in true_lies(bag)})
        for site in TUNING[:2]
        for bag in attacked(folder, site, ATTACKS)
    ]
    return tuned(clean, bags)


Judged = tuple[Sequence[CuedReading], set[Suspect]]
"""What the cues read in a bag, and who lies in it."""


def tuned(clean: Sequence[Judged], attacked_bags: Sequence[Judged]) -> Calibration:
    """The calibration for bags whose liars are known."""
    values = defaultdict(list)
    for readings, _ in clean:
        for cue, reading in readings:
            values[cue].append(reading.value)
    limits = {
        name: max(MARGIN * float(np.quantile(values[name], CLEAN_QUANTILE)) if values[name] else 0.0, least)
        for name, least in LEAST.items()
    }
    sharpness = {name: _sharpness(values[name]) for name in LEAST}
    start = Calibration(
        {name: CueCalibration(limit, 1.0, sharpness[name]) for name, limit in limits.items()}, -12.0, 2.0
    )
    features, lied = [], []
    for readings, lies in [*clean, *attacked_bags]:
        suspicion = CumulativeSuspicion(start)
        for cue, reading in readings:
            if not (GNSS in lies and reading.suspect not in lies and cue in RELYING):
                suspicion.add(cue, reading)
        for suspect, record in suspicion.records.items():
            features.append([record.peak_scores.get(name, 0.0) for name in CUES])
            lied.append(suspect in lies)
    weights, intercept = logistic(np.array(features), np.array(lied))
    cues = {
        name: CueCalibration(round(limits[name], 4), round(float(weight), 4), round(sharpness[name], 2))
        for name, weight in zip(CUES, weights, strict=True)
    }
    return replace(start, cues=cues, intercept=round(intercept, 4), alarm_probability=0.5)


def _sharpness(values: Sequence[float]) -> float:
    """1 where the highest honest readings are twice the middle one or more, up to 6 where they are alike."""
    middle, high = np.quantile(values, [0.5, CLEAN_QUANTILE]) if values else (0.0, 1.0)
    return float(np.clip(0.7 / np.log(high / middle), 1.0, 6.0)) if high > middle > 0 else 1.0


def logistic(features: np.ndarray, lied: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights (C,), none negative, and the intercept of a logistic regression with a ridge."""
    from scipy.optimize import minimize

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        odds = features @ parameters[:-1] + parameters[-1]
        error = 1 / (1 + np.exp(-odds)) - lied
        value = (
            np.logaddexp(0, odds).sum() - odds[lied].sum() + RIDGE * len(lied) * (parameters[:-1] ** 2).sum()
        )
        return float(value), np.r_[features.T @ error + 2 * RIDGE * len(lied) * parameters[:-1], error.sum()]

    bounds = [(0.0, None)] * features.shape[1] + [(None, None)]
    found = minimize(loss, np.zeros(features.shape[1] + 1), jac=True, bounds=bounds, method="L-BFGS-B")
    return found.x[:-1], float(found.x[-1])


@dataclass(frozen=True)
class LieOutcome:
    """What became of a lie. start_error_s, latency_s: NaN where nobody was named for it."""

    lie: TrueLie
    start_error_s: float
    latency_s: float

    @property
    def is_named(self) -> bool:
        """Whether the right suspect was named."""
        return bool(np.isfinite(self.latency_s))


@dataclass(frozen=True)
class BagOutcome:
    """Of one bag: its lies, the wrongly named, and the peak probability of each suspect with the truth."""

    lies: tuple[LieOutcome, ...]
    wrong: tuple[str, ...]
    seconds: float
    probabilities: tuple[tuple[float, bool], ...]


def outcome(readings: Sequence[CuedReading], lies: Sequence[TrueLie], calibration: Calibration) -> BagOutcome:
    """Replay the readings of a bag."""
    suspicion = CumulativeSuspicion(calibration, RELYING)
    for cue, reading in readings:
        suspicion.add(cue, reading)
    named = dict(suspicion.named()[0])
    by_suspect = {lie.suspect: lie for lie in lies}
    wrong = [who for who in named if who not in by_suspect]
    times = [reading.time_ns for _, reading in readings]
    return BagOutcome(
        tuple(_lie_outcome(lie, named) for lie in lies),
        tuple(f"{who.name} by {_strongest(named[who])}" for who in wrong),
        (max(times) - min(times)) / 1e9 if times else 0.0,
        tuple((record.peak, who in by_suspect) for who, record in suspicion.records.items()),
    )


def _strongest(record: SuspectRecord) -> str:
    share = record.episodes[0].cue_share
    return max(share, key=lambda name: share[name])


def _lie_outcome(lie: TrueLie, named: Mapping[Suspect, SuspectRecord]) -> LieOutcome:
    record = named.get(lie.suspect)
    for episode in record.episodes if record else ():
        if episode.end_ns >= lie.start_ns - SLACK_NS and episode.start_ns <= lie.end_ns + SLACK_NS:
            return LieOutcome(
                lie, abs(episode.start_ns - lie.start_ns) / 1e9, max(episode.alarm_ns - lie.start_ns, 0) / 1e9
            )
    return LieOutcome(lie, np.nan, np.nan)


def culprits(outcomes: Iterable[BagOutcome]) -> list[tuple[str, bool, LieOutcome | None]]:
    """For each attack of each bag: its name, whether one who carries it out was named, and the first lie."""
    found = []
    for one in outcomes:
        by_attack: dict[str, list[LieOutcome]] = defaultdict(list)
        for each in one.lies:
            by_attack[each.lie.attack].append(each)
        for attack, lies in by_attack.items():
            named = [each for each in lies if each.is_named]
            found.append((attack, bool(named), min(named, key=lambda e: e.lie.start_ns) if named else None))
    return found


def print_by_attack(outcomes: Mapping[str, Sequence[BagOutcome]]) -> None:
    """A line for each attack: liars that were named, of all; precision; latency; error of the start."""
    print(
        f"{'attack':<28}{'named':>10}{'precision':>11}{'latency s':>11}{'start error s':>15}  wrongly named"
    )
    for attack, bags in outcomes.items():
        lies = [lie for bag in bags for lie in bag.lies]
        named = [lie for lie in lies if lie.is_named]
        wrong = [name for bag in bags for name in bag.wrong]
        precision = len(named) / (len(named) + len(wrong)) if named or wrong else np.nan
        late, off = (
            np.median([getattr(lie, key) for lie in named]) if named else np.nan
            for key in ("latency_s", "start_error_s")
        )
        print(
            f"{attack:<28}{len(named):>4} of {len(lies):<3}{precision:>10.2f}{late:>11.2f}{off:>15.2f}  "
            + ", ".join(wrong[:3])
        )


def print_summary(name: str, outcomes: Sequence[BagOutcome]) -> tuple[float, float]:
    """The share of attacks of which a culprit was named, and the median error of the start."""
    found = culprits(outcomes)
    share = float(np.mean([is_right for _, is_right, _ in found])) if found else np.nan
    errors = [lie.start_error_s for bag in outcomes for lie in bag.lies if lie.is_named]
    median = float(np.median(errors)) if errors else np.nan
    wrong = sum(len(bag.wrong) for bag in outcomes)
    print(
        f"{name}: the right culprit in {100 * share:.0f} % of {len(found)} attacks, median error of the "
        f"start {median:.2f} s, {wrong} wrongly named in {sum(bag.seconds for bag in outcomes):.0f} s"
    )
    return share, median


def print_reliability(outcomes: Iterable[BagOutcome]) -> None:
    """How often those to whom a probability was given truly lied."""
    pairs = np.array([pair for one in outcomes for pair in one.probabilities], np.float64).reshape(-1, 2)
    print(f"{'probability':<16}{'suspects':>9}{'mean':>8}{'truly':>8}")
    for low, high in ((0, 0.1), (0.1, 0.3), (0.3, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.01)):
        part = pairs[(pairs[:, 0] >= low) & (pairs[:, 0] < high)]
        if len(part):
            mean, truly = part.mean(axis=0)
            print(f"{low:.1f} to {min(high, 1):.1f}      {len(part):>9}{mean:>8.2f}{truly:>8.2f}")


def evaluate(folder: Path, coordinated: int, clean_s: float, words: Sequence[str], sites: int) -> bool:
    """Print all tables; whether the marks are reached."""
    calibration = shipped_calibration()
    by_attack: dict[str, list[BagOutcome]] = {word: [] for word in words}
    bags: list[Path] = []
    for site in TESTS[:sites]:
        for word, bag in zip(words, attacked(folder, site, words), strict=True):
            by_attack[word].append(outcome(cued_readings(bag), true_lies(bag), calibration))
            bags.append(bag)
    print(machine())
    print_by_attack(by_attack)
    alone = [one for each in by_attack.values() for one in each]
    share, start_error_s = print_summary("one attack", alone)
    together_bags = [together(folder, site, words) for site, words in coordinated_sites(coordinated)]
    combined = [outcome(cued_readings(bag), true_lies(bag), calibration) for bag in together_bags]
    if combined:
        share, start_error_s = print_summary(f"{coordinated} coordinated drives", combined)
    clean = [
        outcome(cued_readings(recorded(folder, site)), (), calibration) for site in clean_sites(clean_s)
    ] or [outcome(cued_readings(recorded(folder, site)), (), calibration) for site in TESTS[:sites]]
    hours = sum(one.seconds for one in clean) / 3600
    alarms = sum(len(one.wrong) for one in clean)
    print(f"clean: {alarms} false alarms in {hours:.2f} h, {alarms / hours:.1f} an hour")
    print_ablation([*bags, *together_bags], calibration)
    print_reliability([*alone, *combined, *clean])
    factor = real_time_factor(bags[-1])
    return share >= 0.8 and start_error_s <= 1 and alarms / hours <= 6 and factor >= 1


def print_ablation(bags: Sequence[Path], calibration: Calibration) -> None:
    """What is lost without each cue."""
    known = [(cued_readings(bag), true_lies(bag)) for bag in bags]
    for name in ("", *CUES):
        chosen = calibration.without(name) if name else calibration
        outcomes = [outcome(readings, lies, chosen) for readings, lies in known]
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
    parser.add_argument("what", choices=("tune", "evaluate"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--coordinated", type=int, default=12, help="drives with three attacks at once")
    parser.add_argument(
        "--clean-s", type=float, default=3600, help="of clean driving; 0: the test drives alone"
    )
    parser.add_argument("--attacks", nargs="*", default=[*ATTACKS, *MORE])
    parser.add_argument("--sites", type=int, default=len(TESTS), help="how many test maps")
    parser.add_argument("--out", type=Path, help="where tune writes, instead of the package")
    given = parser.parse_args()
    if given.what == "tune":
        found = tune(given.folder)
        path = given.out or Path(calibrations.__file__).with_name(calibrations.FILE)
        path.write_text(json.dumps(found.to_plain(), indent=1) + "\n", encoding="utf-8")
        print(json.dumps(found.to_plain(), indent=1))
        return
    finish(evaluate(given.folder, given.coordinated, given.clean_s, given.attacks, given.sites))


if __name__ == "__main__":
    main()
