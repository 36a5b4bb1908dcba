"""Measures the radio's messages per second, relative to distances and one logarithm of each pair.

    python benchmarks/radio.py [stations] [messages a second of each] [seconds]

Stations stand on a road of 2 km. Prints JSON; `ratio` compares times of the same run.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.medium import Medium
from advpipe.pipeline.v2x.radio.stations import Outcome, Stations, Transmissions
from advpipe.pipeline.v2x.section import Radio

STEP_NS = 100_000_000
CAM_BYTES = 200


def drive(stations: int, rate_hz: float, duration_s: float) -> list[tuple[Stations, Transmissions, int]]:
    """Every station sends at its own phase, at the rate."""
    rng = np.random.default_rng(1)
    ids = np.arange(stations)
    antenna_m = np.column_stack([rng.uniform(0, 2000, stations), rng.uniform(0, 30, stations), 1.5 + 0 * ids])
    period_ns = round(1e9 / rate_hz)
    phase_ns = rng.integers(0, period_ns, stations)
    times_ns = (phase_ns[:, None] + np.arange(int(duration_s * rate_hz)) * period_ns).ravel()
    senders = np.repeat(ids, int(duration_s * rate_hz))
    steps = []
    for end_ns in range(STEP_NS, round(duration_s * 1e9) + 1, STEP_NS):
        rows = np.flatnonzero((times_ns >= end_ns - STEP_NS) & (times_ns < end_ns))
        keys = message_keys(senders[rows], times_ns[rows])
        lengths = np.full(len(rows), CAM_BYTES)
        transmissions = Transmissions(rows, keys, senders[rows], times_ns[rows], lengths)
        steps.append((Stations(ids, antenna_m), transmissions, end_ns))
    return steps


def seconds(works: Sequence[Callable[[], object]], repeats: int = 5) -> list[float]:
    """The fastest run of each, in turns, so that what else the machine does hits them alike."""
    times: list[list[float]] = [[] for _ in works]
    for _ in range(repeats):
        for work, taken in zip(works, times, strict=True):
            start = perf_counter()
            work()
            taken.append(perf_counter() - start)
    return [min(taken) for taken in times]


def main() -> None:
    given = [float(text) for text in sys.argv[1:]]
    stations, rate_hz, duration_s = (*given, *(200.0, 10.0, 3.0)[len(given) :])
    steps = drive(int(stations), rate_hz, duration_s)
    outcomes: list[np.ndarray] = []

    def through_the_medium() -> None:
        medium = Medium(Radio(), seed=1)
        outcomes.clear()
        for where, transmissions, until_ns in steps:
            outcomes.append(medium.advance(until_ns, where, transmissions).outcomes.outcome.ravel())

    def bare() -> None:
        for where, transmissions, _ in steps:
            delta_m = where.antenna_m[transmissions.senders, None] - where.antenna_m
            np.log10(np.linalg.norm(delta_m, axis=2) + 1)

    medium_s, bare_s = seconds([through_the_medium, bare])
    messages = sum(len(transmissions) for _, transmissions, _ in steps)
    counts = np.bincount(np.concatenate(outcomes), minlength=len(Outcome))
    report = {
        "messages_per_s": round(messages / medium_s),
        "pairs_per_s": round(messages * stations / medium_s),
        "share_of_real_time": round(medium_s / duration_s, 3),
        "ratio": round(medium_s / bare_s, 1),
        "outcomes": {outcome.name: int(counts[outcome]) for outcome in Outcome},
    }
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
