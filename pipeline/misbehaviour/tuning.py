"""Tuning of thresholds on drives: what honest messages reach, and what detects attacks best.

Both detectors are tuned on the same streams: of the settings whose false-positive rate on clean streams
stays within the bound, the one with the highest mean F1 over the attacks is chosen. The baseline is tuned
without the bound as well, as its authors did.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.detector import judge_all
from advpipe.pipeline.misbehaviour.scores import Bools, scores

MAX_FALSE_POSITIVE_RATE = 0.005
"""Share of clean messages on the tuning drives: half of the 1 % accepted on other drives."""
WORST_STREAM = 1.5
"""A single receiver's share of clean messages may be so many times as large."""
EXCEEDANCE_SHARES = (0.0, 0.0003, 0.0007, 0.0015, 0.003)
"""Shares of clean messages that may be above a check's tuned threshold; with 0, its margin is added."""
FIRST_SHARE = 0.0003
"""Where the search begins."""
PARDON_S = (3.0, 10.0, 30.0)
"""Never infinite: real drives last longer than tuning drives, and an honest station may be flagged once."""
_LEAST_GAIN = 1e-4
_OF_THE_PLACE = ("range", "speed")
"""What honest messages reach depends on the place, so the highest, with its margin, is kept."""


@dataclass(frozen=True)
class Stream:
    """The messages that one receiver received in order of arrival, and which of them are false (M,)."""

    claims: Sequence[Claim]
    receivers: Sequence[ReceivingVehicle]
    is_false: Bools
    attack: str = ""


class TuningScore(NamedTuple):
    """How a setting does: the mean F1 over the attacks, and the false-positive rate on clean streams."""

    mean_f1: float
    false_positive_rate: float


class Tuned(NamedTuple):
    """The chosen settings, and their score on the streams they were chosen on."""

    config: DetectorConfig
    score: TuningScore


Evaluate = Callable[[DetectorConfig], TuningScore]


def tuning_score(streams: Sequence[Stream], flags: Iterable[Bools]) -> TuningScore:
    """The score of flags on streams; those without an attack's name are clean."""
    clean = flagged_clean = 0
    by_attack: dict[str, list[tuple[Bools, Bools]]] = {}
    for stream, flagged in zip(streams, flags, strict=True):
        if stream.attack:
            by_attack.setdefault(stream.attack, []).append((flagged, stream.is_false))
        else:
            clean, flagged_clean = clean + len(flagged), flagged_clean + int(flagged.sum())
    found = [
        scores(np.concatenate([f for f, _ in pairs]), np.concatenate([false for _, false in pairs])).f1
        for pairs in by_attack.values()
    ]
    known = [value for value in found if math.isfinite(value)]
    return TuningScore(float(np.mean(known)) if known else 0.0, flagged_clean / clean if clean else 0.0)


def evaluated(streams: Sequence[Stream]) -> Evaluate:
    """The evaluation of our detector on streams, one after the other.

    The false-positive rate is that of all clean streams or, if larger, that of the worst one over
    `WORST_STREAM`, so that one map's traffic does not hide behind another's. Where it is beyond the bound,
    the attacked streams are left out: F1 is zero.
    """
    clean = [stream for stream in streams if not stream.attack]
    attacked = [stream for stream in streams if stream.attack]

    def evaluate(config: DetectorConfig) -> TuningScore:
        flags = list(_flags(clean, config))
        worst = max((float(flagged.mean()) for flagged in flags if len(flagged)), default=0.0)
        rate = max(tuning_score(clean, flags).false_positive_rate, worst / WORST_STREAM)
        if rate > MAX_FALSE_POSITIVE_RATE:
            return TuningScore(0.0, rate)
        return TuningScore(tuning_score(attacked, _flags(attacked, config)).mean_f1, rate)

    return evaluate


def _flags(streams: Iterable[Stream], config: DetectorConfig) -> Iterator[Bools]:
    return (judge_all(each.claims, each.receivers, config).flagged for each in streams)


def threshold_candidates(clean: Iterable[Stream], base: DetectorConfig) -> dict[str, tuple[float, ...]]:
    """The thresholds to try for each tuned check, from high to low: what a share of `EXCEEDANCE_SHARES` of
    clean messages exceeds, and never less than the check's `least`.

    A check that never applied keeps the threshold of `base`.
    """
    watching = base.with_thresholds({})
    tables = [judge_all(each.claims, each.receivers, watching).statistics for each in clean]
    statistics = np.concatenate(tables) if tables else np.zeros((0, len(CHECKS)))
    found = {}
    for column, (name, check) in enumerate(CHECKS.items()):
        values = statistics[:, column]
        values = values[np.isfinite(values)]
        if not (check.is_tuned and name in base.thresholds):
            continue
        levels = {base.thresholds[name]}
        if len(values):
            # If no honest message shows a deviation, that does not say how small one a false message shows.
            levels = {
                max(float(np.quantile(values, 1 - share)) * (1.0 if share else check.margin), check.least)
                for share in ((0.0,) if name in _OF_THE_PLACE else EXCEEDANCE_SHARES)
            }
        found[name] = tuple(sorted(levels, reverse=True))
    return found


def tune(
    candidates: Mapping[str, Sequence[float]], evaluate: Evaluate, base: DetectorConfig | None = None
) -> Tuned:
    """Choose the best thresholds, one check after the other until none improves, and the pardon times last.

    Raises ValueError where no setting is within the bound.
    """
    base = base or DetectorConfig()
    start = FIRST_SHARE
    first = {name: _at_share(levels, start) for name, levels in candidates.items()}
    best = _try(base.with_thresholds({**base.thresholds, **first}), evaluate, None)
    if best is None:  # nothing that honest messages reach
        highest = {name: levels[0] for name, levels in candidates.items()}
        best = _try(base.with_thresholds({**base.thresholds, **highest}), evaluate, None)
    if best is None:
        raise ValueError(f"no setting flags less than {MAX_FALSE_POSITIVE_RATE:.1%} of the clean messages")
    settled = 0  # how many checks in a row have their best threshold, given those of the others
    for name, levels in cycle(candidates.items()):
        if settled >= len(candidates):
            break
        before, best = best, _best_threshold(name, levels, evaluate, best)
        settled = settled + 1 if best is before else 1
    for pardon_s in PARDON_S:
        best = _try(replace(best.config, pardon_s=pardon_s), evaluate, best) or best
    for pardon_s in PARDON_S:
        best = _try(replace(best.config, acceleration_pardon_s=pardon_s), evaluate, best) or best
    return best


def _at_share(levels: Sequence[float], share: float) -> float:
    """The level of a share where there are as many levels as shares; of fewer, the second highest."""
    place = EXCEEDANCE_SHARES.index(share)
    return levels[min(place, len(levels) - 1)]


def _best_threshold(name: str, levels: Sequence[float], evaluate: Evaluate, best: Tuned) -> Tuned:
    """Step down from the present threshold as long as that is better; if it never was, up."""
    for direction in (1, -1):
        start = best
        place = levels.index(best.config.thresholds[name]) + direction
        while 0 <= place < len(levels):
            thresholds = {**best.config.thresholds, name: levels[place]}
            found = _try(best.config.with_thresholds(thresholds), evaluate, best)
            if found is None:
                break
            best, place = found, place + direction
        if best is not start:
            break
    return best


def _try(config: DetectorConfig, evaluate: Evaluate, best: Tuned | None) -> Tuned | None:
    """The setting with its score, if it is within the bound and better than the best one so far."""
    score = evaluate(config)
    if score.false_positive_rate > MAX_FALSE_POSITIVE_RATE:
        return None
    if best is not None and score.mean_f1 <= best.score.mean_f1 + _LEAST_GAIN:
        return None
    return Tuned(config, score)
