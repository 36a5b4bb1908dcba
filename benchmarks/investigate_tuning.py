"""Fits what `advpipe investigate` holds for usual: limits of the cues, their weights, and the probability.

A unit is one suspect in one window of 16 s: by cue the highest score in it, and whether it lies then.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from investigate_drives import CuedReading, TrueLie

from advpipe.stages.investigate.calibration import Calibration, CueCalibration
from advpipe.stages.investigate.cue import GNSS, Suspect
from advpipe.stages.investigate.registry import CUES
from advpipe.stages.investigate.run import RELYING
from advpipe.stages.investigate.suspicion import CumulativeSuspicion

WINDOW_NS = 16_000_000_000
GRID = 1.0 + 0.08 * np.arange(60)
"""Limits that are tried, as multiples of the middle of honest readings."""
HIGH_SCORE, HIGH_SHARE = 2.0, 0.004
"""The limit of a cue is the smallest at which so few honest units reach so high a score."""
RIDGE, PRIOR_WEIGHT = 0.5, 0.7
"""Weights are drawn to the prior: of a cue that no tuning drive needs, a regression knows nothing."""
FOLDS = 5
MOST_LIARS = 5
SURE_SCORE = 0.9
"""A cue whose score reaches this share of the ceiling names a suspect by itself: few honest ones get a
quarter of it, and what no tuning drive shows would otherwise never be heard."""

Judged = tuple[Sequence[CuedReading], Sequence[TrueLie]]
"""What the cues read in a bag, and who lies in it."""


@dataclass(frozen=True)
class Units:
    """scores: (U, C), by cue in the order of `CUES`. lied: (U,). group: (U,) the number of the bag. worth:
    (U,) how much each counts: a flood of ids that one attacker makes up counts as `MOST_LIARS` of them."""

    scores: np.ndarray
    lied: np.ndarray
    group: np.ndarray

    @property
    def worth(self) -> np.ndarray:
        liars = np.bincount(self.group, self.lied)[self.group]
        return np.where(self.lied, np.minimum(1.0, MOST_LIARS / np.maximum(liars, 1)), 1.0)


def tuned(bags: Sequence[Judged], least: dict[str, float]) -> Calibration:
    """The calibration for bags whose liars are known. least: limits are never below these."""
    clean = [readings for readings, lies in bags if not lies]
    start = Calibration(
        {name: CueCalibration(limit, 1.0, sharpness) for name, (limit, sharpness) in _limits(clean, least)},
        -8.0,
    )
    found = units(bags, start)
    weights, intercept = logistic(found.scores, found.lied, found.worth)
    slope, offset = platt(crossvalidated(found), found.lied, found.worth)
    odds = slope * intercept + offset
    least_weight = max(-odds, 0.0) / (SURE_SCORE * start.ceiling)
    cues = {
        name: replace(start.cues[name], weight=round(max(float(slope * weight), least_weight), 4))
        for name, weight in zip(CUES, weights, strict=True)
    }
    return replace(start, cues=cues, intercept=round(float(odds), 4))


def _limits(
    clean: Sequence[Sequence[CuedReading]], least: dict[str, float]
) -> Iterator[tuple[str, tuple[float, float]]]:
    for name in CUES:
        series = _by_unit(name, clean)
        values = np.concatenate([[value for _, value in each] for each in series]) if series else np.zeros(0)
        sharpness = _sharpness(values)
        low = max(least[name], float(np.median(values)) if len(values) else 0.0)
        limit = next(
            (low * times for times in GRID if _high_share(series, low * times, sharpness) <= HIGH_SHARE),
            low * float(GRID[-1]),
        )
        yield name, (round(limit, 4), round(sharpness, 2))


def _sharpness(values: np.ndarray) -> float:
    """1 where the highest honest readings are twice the middle one or more, up to 4 where they are alike."""
    middle, high = np.quantile(values, [0.5, 0.99]) if len(values) else (0.0, 1.0)
    return float(np.clip(0.7 / np.log(high / middle), 1.0, 4.0)) if high > middle > 0 else 1.0


def _by_unit(cue: str, bags: Iterable[Sequence[CuedReading]]) -> list[list[tuple[int, float]]]:
    """Times and values of a cue's readings, by bag, suspect and window."""
    series: dict[tuple[int, Suspect, int], list[tuple[int, float]]] = defaultdict(list)
    for number, readings in enumerate(bags):
        for name, reading in readings:
            if name == cue:
                key = number, reading.suspect, reading.time_ns // WINDOW_NS
                series[key].append((reading.time_ns, reading.value))
    return list(series.values())


def _high_share(series: list[list[tuple[int, float]]], limit: float, sharpness: float) -> float:
    """The share of units whose cumulative score gets high with a limit."""
    one = Calibration({"cue": CueCalibration(limit, 1.0, sharpness)}, 0.0)
    return sum(_peak(each, one) > HIGH_SCORE for each in series) / max(len(series), 1)


def _peak(series: list[tuple[int, float]], one: Calibration) -> float:
    score, before_ns, peak = 0.0, series[0][0], 0.0
    for time_ns, value in series:
        faded = score * 0.5 ** (max(time_ns - before_ns, 0) / 1e9 / one.half_life_s)
        score = min(max(faded + one.step("cue", value), 0.0), one.ceiling)
        before_ns, peak = time_ns, max(peak, score)
    return peak


class _Windows(CumulativeSuspicion):
    """Keeps the highest scores by suspect and window."""

    def __init__(self, calibration: Calibration) -> None:
        super().__init__(calibration)
        self.peaks: dict[tuple[Suspect, int], dict[str, float]] = defaultdict(dict)

    def add(self, cue: str, reading: object) -> None:
        super().add(cue, reading)  # type: ignore[arg-type]
        who, time_ns = reading.suspect, reading.time_ns  # type: ignore[attr-defined]
        peaks = self.peaks[who, time_ns // WINDOW_NS]
        peaks[cue] = max(peaks.get(cue, 0.0), self.records[who].scores[cue].score)


def units(bags: Sequence[Judged], calibration: Calibration) -> Units:
    """All units of bags, but honest stations as cues see them whom a false GNSS misleads."""
    scores, lied, group = [], [], []
    for number, (readings, lies) in enumerate(bags):
        false_gnss = [lie for lie in lies if lie.suspect == GNSS]
        windows = _Windows(calibration)
        for cue, reading in readings:
            if not (cue in RELYING and any(one.start_ns <= reading.time_ns for one in false_gnss)):
                windows.add(cue, reading)
        for (who, window), peaks in windows.peaks.items():
            scores.append([peaks.get(name, 0.0) for name in CUES])
            lied.append(
                any(
                    one.suspect == who and one.start_ns // WINDOW_NS <= window <= one.end_ns // WINDOW_NS
                    for one in lies
                )
            )
            group.append(number)
    return Units(np.array(scores), np.array(lied), np.array(group))


def logistic(scores: np.ndarray, lied: np.ndarray, worth: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights (C,), none negative, and the intercept of a logistic regression with a prior."""
    from scipy.optimize import minimize

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        odds, apart = scores @ parameters[:-1] + parameters[-1], parameters[:-1] - PRIOR_WEIGHT
        error = worth * (1 / (1 + np.exp(-np.clip(odds, -50, 50))) - lied)
        value = (worth * (np.logaddexp(0, odds) - lied * odds)).sum() + RIDGE * (apart**2).sum()
        return float(value), np.r_[scores.T @ error + 2 * RIDGE * apart, error.sum()]

    bounds = [(0.0, None)] * scores.shape[1] + [(None, None)]
    start = np.r_[np.full(scores.shape[1], PRIOR_WEIGHT), -3.0]
    found = minimize(loss, start, jac=True, bounds=bounds, method="L-BFGS-B")
    return found.x[:-1], float(found.x[-1])


def crossvalidated(found: Units) -> np.ndarray:
    """The log odds (U,) of each unit by weights from other bags."""
    odds = np.zeros(len(found.lied))
    for fold in range(FOLDS):
        mine = found.group % FOLDS == fold
        weights, intercept = logistic(found.scores[~mine], found.lied[~mine], found.worth[~mine])
        odds[mine] = found.scores[mine] @ weights + intercept
    return odds


def platt(odds: np.ndarray, lied: np.ndarray, worth: np.ndarray) -> tuple[float, float]:
    """Slope and offset that make log odds (U,) calibrated (Platt 1999, with his smoothed targets)."""
    from scipy.optimize import minimize

    many, few = float(worth[lied].sum()), float(worth[~lied].sum())
    target = np.where(lied, (many + 1) / (many + 2), 1 / (few + 2))

    def loss(parameters: np.ndarray) -> float:
        turned = parameters[0] * odds + parameters[1]
        return float((worth * (np.logaddexp(0, turned) - target * turned)).sum())

    found = minimize(loss, np.array([1.0, 0.0]), method="L-BFGS-B", bounds=[(0.2, 3.0), (None, None)])
    return float(found.x[0]), float(found.x[1])
