"""Tuning of the baseline, CaTCH's checks, by random search over the space that VeReMi NextGen searched."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.misbehaviour.catch import (
    PUBLISHED_CATCH,
    CatchMessages,
    CatchParameters,
    catch_flags,
    catch_messages,
)
from advpipe.pipeline.misbehaviour.tuning import (
    MAX_FALSE_POSITIVE_RATE,
    Stream,
    TuningScore,
    tuning_score,
)

DRAWS, REFINEMENTS = 200, 100
"""Parameters drawn anywhere, and then near the best ones."""
_CHANGED_SHARE, _CHANGE = 0.3, 0.1

CATCH_RANGES: dict[str, tuple[float, float]] = {
    "max_range_m": (300.0, 1000.0),
    "max_off_road_m": (0.0, 5.0),
    "max_speed_mps": (30.0, 70.0),
    "max_acceleration_mps2": (3.0, 10.0),
    "max_deceleration_mps2": (3.0, 20.0),
    "max_heading_change_rad": (math.radians(45), math.radians(145)),
    "max_intersection_s": (1.0, 5.0),
    "max_time_s": (1.0, 5.0),
    "heading_time_s": (0.3, 5.0),
    "margin_up_m": (0.0, 7.0),
    "margin_down_m": (0.0, 7.0),
    "off_road_speed_mps": (0.0, 3.0),
}
"""The published intervals; two are wider: radios here reach farther than 500 m, and the parameters published
for VeReMi Extension compare headings within 0.4 s."""


class TunedCatch(NamedTuple):
    """The chosen parameters of the baseline, and their score."""

    parameters: CatchParameters
    score: TuningScore


def tune_catch(
    streams: Sequence[Stream], seed: int = 0, most_flagged: float = MAX_FALSE_POSITIVE_RATE
) -> TunedCatch:
    """The parameters with the highest mean F1 of those that flag at most this share of clean messages; where
    none does, those that flag the fewest. most_flagged: 1 to tune for F1 alone."""
    messages = [catch_messages(each.claims, each.receivers) for each in streams]
    best: TunedCatch | None = None
    rng = named_generator(seed, "misbehaviour/catch")
    for parameters in _draws(rng):
        best = _better(best, _scored(streams, messages, parameters), most_flagged)
    assert best is not None
    for _ in range(REFINEMENTS):
        near = _scored(streams, messages, _near(best.parameters, rng))
        best = _better(best, near, most_flagged)
    return best


def _better(best: TunedCatch | None, found: TunedCatch, most_flagged: float) -> TunedCatch:
    if best is None:
        return found
    rate, best_rate = found.score.false_positive_rate, best.score.false_positive_rate
    if max(rate, best_rate) > most_flagged:
        return found if rate < best_rate else best
    return found if found.score.mean_f1 > best.score.mean_f1 else best


def _scored(
    streams: Sequence[Stream], messages: Sequence[CatchMessages], parameters: CatchParameters
) -> TunedCatch:
    flags = (catch_flags(each, parameters) for each in messages)
    return TunedCatch(parameters, tuning_score(streams, flags))


def _draws(rng: np.random.Generator) -> Iterator[CatchParameters]:
    yield from PUBLISHED_CATCH.values()
    for _ in range(DRAWS):
        draws = rng.random(len(CATCH_RANGES)).tolist()
        yield CatchParameters(
            **{
                name: low + draw * (high - low)
                for draw, (name, (low, high)) in zip(draws, CATCH_RANGES.items(), strict=True)
            }
        )


def _near(parameters: CatchParameters, rng: np.random.Generator) -> CatchParameters:
    """Some of the parameters, moved by up to a tenth of their intervals."""
    values = asdict(parameters)
    for name, (low, high) in CATCH_RANGES.items():
        is_changed, move = rng.random() < _CHANGED_SHARE, rng.uniform(-_CHANGE, _CHANGE)
        if is_changed:
            values[name] = float(np.clip(values[name] + move * (high - low), low, high))
    return CatchParameters(**values)
