"""Tuning of thresholds on drives: what honest messages reach, and what detects attacks best.

Both detectors are tuned on the same streams: of the settings whose false-positive rate on clean streams
stays within the bound, the one with the highest mean F1 over the attacks is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.misbehaviour.catch import (
    CatchMessages,
    CatchParameters,
    catch_flags,
    catch_messages,
)
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.detector import judge_all
from advpipe.pipeline.misbehaviour.scores import Bools, scores

MAX_FALSE_POSITIVE_RATE = 0.005
"""Share of clean messages on the tuning drives: half of the 1 % accepted on other drives."""
EXCEEDANCE_SHARES = (0.0, 0.0005, 0.001)
"""Shares of clean messages that may be above a check's tuned threshold."""
PARDON_S = (3.0, 10.0, 30.0)
"""Never infinite: real drives last longer than tuning drives, and an honest station may be flagged once."""
CATCH_DRAWS = 300


@dataclass(frozen=True)
class Stream:
    """The messages that one receiver received in order of arrival, and which of them are false (M,)."""

    claims: Sequence[Claim]
    receivers: Sequence[ReceivingVehicle]
    is_false: Bools
    attack: str = ""


class Tuned(NamedTuple):
    """The chosen settings, and their scores on the streams they were chosen on."""

    config: DetectorConfig
    mean_f1: float
    false_positive_rate: float


class TunedCatch(NamedTuple):
    """The chosen parameters of the baseline, and their scores."""

    parameters: CatchParameters
    mean_f1: float
    false_positive_rate: float


def clean_thresholds(streams: Iterable[Stream], exceeded: float, base: DetectorConfig) -> dict[str, float]:
    """The threshold of each tuned check: what the share `exceeded` of clean messages exceeds, times its
    margin.

    A check that never applied, and one with a rule, keeps the threshold of `base`.
    """
    watching = base.with_thresholds({})
    tables = [judge_all(each.claims, each.receivers, watching).statistics for each in streams]
    statistics = np.concatenate(tables) if tables else np.zeros((0, len(CHECKS)))
    found = dict(base.thresholds)
    for column, (name, check) in enumerate(CHECKS.items()):
        values = statistics[:, column]
        values = values[np.isfinite(values)]
        if check.is_tuned and name in found and len(values):
            level = float(np.quantile(values, 1 - exceeded)) * check.margin
            # If no honest message shows a deviation, that does not say how small one a false message shows.
            found[name] = max(level, check.least)
    return found


def tune(clean: Sequence[Stream], attacked: Sequence[Stream], base: DetectorConfig | None = None) -> Tuned:
    """Choose the best thresholds, and then the best pardon time with them.

    Raises ValueError where no setting is within the bound.
    """
    base = base or DetectorConfig()
    by_share = [base.with_thresholds(clean_thresholds(clean, share, base)) for share in EXCEEDANCE_SHARES]
    best = _best(by_share, clean, attacked)
    if not attacked:
        return best
    return _best([replace(best.config, pardon_s=pardon_s) for pardon_s in PARDON_S], clean, attacked, best)


def _best(
    configs: Sequence[DetectorConfig],
    clean: Sequence[Stream],
    attacked: Sequence[Stream],
    best: Tuned | None = None,
) -> Tuned:
    """The best of these settings and the best one before."""
    for config in configs:
        if best is not None and config == best.config:
            continue
        rate = _false_positive_rate([judge_all(s.claims, s.receivers, config).flagged for s in clean])
        if rate > MAX_FALSE_POSITIVE_RATE:
            continue
        flags = (judge_all(s.claims, s.receivers, config).flagged for s in attacked)
        mean_f1 = _mean_f1(attacked, flags)
        if best is None or mean_f1 > best.mean_f1:
            best = Tuned(config, mean_f1, rate)
    if best is None:
        raise ValueError(f"no setting flags less than {MAX_FALSE_POSITIVE_RATE:.1%} of the clean messages")
    return best


def tune_catch(clean: Sequence[Stream], attacked: Sequence[Stream], seed: int = 0) -> TunedCatch:
    """Tune the baseline by random search over its parameters; where no draw is within the bound,
    choose the one with the fewest false positives."""
    honest = [catch_messages(s.claims, s.receivers) for s in clean]
    attacked_messages = [catch_messages(s.claims, s.receivers) for s in attacked]
    best: TunedCatch | None = None
    for parameters in _catch_draws(seed):
        rate = _false_positive_rate([catch_flags(each, parameters) for each in honest])
        if best is not None and rate > max(MAX_FALSE_POSITIVE_RATE, best.false_positive_rate):
            continue
        mean_f1 = _mean_f1(attacked, _catch_all(attacked_messages, parameters))
        is_first_within = best is not None and best.false_positive_rate > MAX_FALSE_POSITIVE_RATE
        if best is None or is_first_within or mean_f1 > best.mean_f1:
            best = TunedCatch(parameters, mean_f1, rate)
    assert best is not None
    return best


CATCH_RANGES: dict[str, tuple[float, float]] = {
    "max_range_m": (250.0, 900.0),
    "max_speed_mps": (18.0, 57.0),
    "max_acceleration_mps2": (2.5, 8.0),
    "max_deceleration_mps2": (4.0, 10.0),
    "max_heading_change_rad": (0.5, 2.0),
    "max_intersection_s": (0.5, 3.0),
    "max_time_s": (1.0, 5.0),
    "max_off_road_m": (0.5, 10.0),
    "heading_time_s": (0.5, 3.0),
    "margin_up_m": (0.2, 10.0),
    "margin_down_m": (0.2, 10.0),
    "off_road_speed_mps": (0.1, 3.0),
}
"""The intervals that the baseline's parameters are drawn from."""


def _catch_draws(seed: int) -> Iterator[CatchParameters]:
    yield CatchParameters()
    rng = named_generator(seed, "misbehaviour/catch")
    names = [field.name for field in fields(CatchParameters)]
    for _ in range(CATCH_DRAWS):
        draws = rng.random(len(names)).tolist()
        values = {
            name: low + draw * (high - low)
            for name, draw, (low, high) in zip(names, draws, (CATCH_RANGES[n] for n in names), strict=True)
        }
        yield CatchParameters(**values)


def _catch_all(messages: Sequence[CatchMessages], parameters: CatchParameters) -> Iterator[Bools]:
    return (catch_flags(each, parameters) for each in messages)


def _mean_f1(attacked: Sequence[Stream], flags: Iterable[npt.NDArray[np.bool_]]) -> float:
    """The mean F1 over the attacks, each scored over all of its receivers."""
    by_attack: dict[str, list[tuple[Bools, Bools]]] = {}
    for stream, flagged in zip(attacked, flags, strict=True):
        by_attack.setdefault(stream.attack, []).append((flagged, stream.is_false))
    found = [
        scores(np.concatenate([f for f, _ in pairs]), np.concatenate([false for _, false in pairs])).f1
        for pairs in by_attack.values()
    ]
    known = [value for value in found if math.isfinite(value)]
    return float(np.mean(known)) if known else 0.0


def _false_positive_rate(flags: Sequence[Bools]) -> float:
    total = sum(map(len, flags))
    return sum(int(each.sum()) for each in flags) / total if total else 0.0
