"""How well lies in V2X messages are found out: every registered `cam-` attack, ours and the baseline.

Simulates a drive to tune on and another to test on (other traffic, same map), carries out every attack on
both, with the same share of attackers and the same labels, tunes the thresholds of both detectors on the
first, and prints on the second, per attack: lies, precision, recall, F1, MCC and latency of ours, F1 of the
baseline built from CaTCH's checks, and what is published of CaTCH on other data.

Reaches: a mean F1 above the baseline's, under 1 % of the clean messages flagged, and a minute of messages of
one receiver judged within ten seconds.

    python benchmarks/misbehaviour.py [--seconds 60] [--only cam-replay ...] [--set key=value] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from common import finish, machine, scratch

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.detector import judge_all
from advpipe.pipeline.misbehaviour.tuning import Stream, tune, tune_catch
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.registry import ATTACKS
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.evaluate.v2x.detection import PUBLISHED_CATCH_F1, detect
from advpipe.stages.evaluate.v2x.labels import MessageLabel, lies, read_labels
from advpipe.stages.evaluate.v2x.receptions import Receptions, read_receptions
from advpipe.stages.simulate.run import simulate

COARSE = ("sensors.lidars.lidar.channels=2", "sensors.lidars.lidar.points_per_second=4000")
FROM_S = 3.0
"""Attacks begin when the first honest messages have been heard."""
LIKE_NEXTGEN: dict[str, dict[str, float]] = {"cam-speed-constant": {"speed_mps": 0.0}}
"""Parameters that make an attack the one that the published figure is of."""
MOST_FALSE_POSITIVES, MOST_SECONDS = 0.01, 10.0


class Read(NamedTuple):
    """What the listeners of a bag received, with its labels."""

    attack: str
    receptions: list[Receptions]
    labels: list[MessageLabel]

    def streams(self) -> list[Stream]:
        return [
            Stream(one.claims, one.receivers, lies(one.numbers, self.labels), self.attack)
            for one in self.receptions
        ]


def drive(
    folder: Path, seed: int, seconds: float, settings: Sequence[str], words: Sequence[str]
) -> list[Read]:
    """The clean drive, then each attack on it; attacks that this drive gives no chance are left out."""
    base = folder / f"seed-{seed}"
    if not (base / "clean").exists():
        chosen = [*COARSE, f"simulation.duration_s={seconds}", f"simulation.seed={seed}", *settings]
        simulate(load_scenario("boulevard", chosen), base)
    clean = base / "clean"
    found = [Read("", read_receptions(BagReader(clean)), [])]
    for word in words:
        out = base / word
        try:
            if not out.exists():
                attack(clean, out, AttackRequest((spec(word),), seed=seed))
        except AdvpipeError as error:
            print(f"seed {seed}: {word} left out: {error}")
            continue
        found.append(Read(word, read_receptions(BagReader(out)), read_labels(out)))
        print(f"seed {seed}: {word}, {len(found[-1].labels)} messages touched", file=sys.stderr)
    return found


def spec(word: str) -> AttackSpec:
    """An attack with its defaults, by a fifth of the fleet; on the ego where it needs a victim."""
    parameters = LIKE_NEXTGEN.get(word, {})
    return AttackSpec(type=word, parameters=parameters, schedule=Schedule(from_s=FROM_S), victim="ego")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seeds", type=int, nargs=2, default=(1, 2), help="to tune on, to test on")
    parser.add_argument("--only", nargs="*", help="these attacks alone")
    parser.add_argument("--set", action="append", default=[], help="of the scenario")
    parser.add_argument("--keep", type=Path, help="folder for the bags; a temporary one if left out")
    given = parser.parse_args()
    words = given.only or [word for word in ATTACKS if word.startswith("cam-")]
    print(machine())
    with scratch() as temporary:
        folder = given.keep or Path(temporary)
        tuning, testing = (drive(folder, seed, given.seconds, given.set, words) for seed in given.seeds)
    clean, attacked = tuning[0].streams(), [s for each in tuning[1:] for s in each.streams()]
    ours, baseline = tune(clean, attacked), tune_catch(clean, attacked)
    print(f"tuned on seed {given.seeds[0]}: mean F1 ours {ours.mean_f1:.3f}, baseline {baseline.mean_f1:.3f}")
    print("  thresholds: " + ", ".join(f"{n} {ours.config.thresholds[n]:.4g}" for n in CHECKS))
    print(f"  pardon {ours.config.pardon_s:g} s; baseline: {baseline.parameters}")
    head = ("attack", "lies", "precis", "recall", "F1", "MCC", "late s", "base F1", "CaTCH")
    print(f"{head[0]:28}" + "".join(f"{word:>9}" for word in head[1:]))
    ours_f1, base_f1 = [], []
    for each in testing:
        found = detect(each.receptions, each.labels, ours.config, baseline.parameters)
        if not each.attack:
            clean_rate = found.ours.false_positive_rate, found.baseline.false_positive_rate
            continue
        if found.lies:
            ours_f1.append(found.ours.f1)
            base_f1.append(found.baseline.f1)
        figures = (
            *(found.ours.precision, found.ours.recall, found.ours.f1, found.ours.mcc),
            *(found.ours.latency_s, found.baseline.f1, PUBLISHED_CATCH_F1.get(each.attack, math.nan)),
        )
        print(f"{each.attack:28}{found.lies:9d}" + "".join(f"{value:9.3f}" for value in figures))
    mean, base = (float(np.nanmean(values)) if values else math.nan for values in (ours_f1, base_f1))
    better = sum(a > b for a, b in zip(ours_f1, base_f1, strict=True))
    print(
        f"mean F1 ours {mean:.3f}, baseline {base:.3f}; ours is better at {better} of {len(ours_f1)} attacks"
    )
    print(
        f"clean messages flagged: ours {clean_rate[0]:.2%}, baseline {clean_rate[1]:.2%} (reach: under 1 %)"
    )
    seconds = timed(testing[0], ours.config) * 60 / given.seconds
    print(f"a minute of messages of one receiver takes {seconds:.1f} s (reach: at most {MOST_SECONDS:g})")
    finish(mean > base and clean_rate[0] < MOST_FALSE_POSITIVES and seconds <= MOST_SECONDS)


def timed(clean: Read, config: DetectorConfig) -> float:
    """Seconds that one receiver's messages take."""
    one = clean.receptions[0]
    start_s = time.perf_counter()
    judge_all(one.claims, one.receivers, config)
    return time.perf_counter() - start_s


if __name__ == "__main__":
    main()
