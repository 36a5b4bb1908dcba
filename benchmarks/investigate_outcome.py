"""What became of the lies in a bag: who was named for them, how late, and who was named wrongly."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from investigate_drives import CuedReading, TrueLie
from investigate_tuning import WINDOW_NS

from advpipe.stages.investigate.calibration import Calibration
from advpipe.stages.investigate.cue import Suspect
from advpipe.stages.investigate.run import RELYING
from advpipe.stages.investigate.suspicion import CumulativeSuspicion, SuspectRecord

SLACK_NS = 2_000_000_000
"""An alarm that ends so long before a lie, or begins so long after it, still belongs to it."""


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
    """Of one bag: its lies, the wrongly named, and by suspect and window of 16 s the highest probability with
    the truth."""

    lies: tuple[LieOutcome, ...]
    wrong: tuple[str, ...]
    seconds: float
    probabilities: tuple[tuple[float, bool], ...]


def outcome(readings: Sequence[CuedReading], lies: Sequence[TrueLie], calibration: Calibration) -> BagOutcome:
    """Replay the readings of a bag."""
    suspicion = CumulativeSuspicion(calibration, RELYING)
    peaks: dict[tuple[Suspect, int], float] = defaultdict(float)
    for cue, reading in readings:
        suspicion.add(cue, reading)
        record = suspicion.records.get(reading.suspect)
        if record is not None:
            key = reading.suspect, reading.time_ns // WINDOW_NS
            peaks[key] = max(peaks[key], record.probability)
    named = dict(suspicion.named()[0])
    by_suspect = {lie.suspect: lie for lie in lies}
    wrong = [who for who in named if who not in by_suspect]
    times = [reading.time_ns for _, reading in readings]
    return BagOutcome(
        tuple(_lie_outcome(lie, named) for lie in lies),
        tuple(f"{who.name} by {_strongest(named[who])}" for who in wrong),
        (max(times) - min(times)) / 1e9 if times else 0.0,
        tuple((value, _lies_in(window, by_suspect.get(who))) for (who, window), value in peaks.items()),
    )


def _lies_in(window: int, lie: TrueLie | None) -> bool:
    return lie is not None and lie.start_ns // WINDOW_NS <= window <= lie.end_ns // WINDOW_NS


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
    """For each attack of each bag: its name, whether one who carries it out was named, and the first of the
    lies that were."""
    found = []
    for one in outcomes:
        by_attack: dict[str, list[LieOutcome]] = defaultdict(list)
        for each in one.lies:
            by_attack[each.lie.attack].append(each)
        for attack, lies in by_attack.items():
            named = [each for each in lies if each.is_named]
            found.append((attack, bool(named), min(named, key=lambda e: e.lie.start_ns) if named else None))
    return found
