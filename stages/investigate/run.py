"""Find out which sensor or station lied in a recorded drive, from what the vehicle itself had."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.progress import track
from advpipe.stages.investigate.calibration import Calibration, shipped_calibration
from advpipe.stages.investigate.cue import CueReading, Suspect
from advpipe.stages.investigate.evidence_topics import EvidenceTopics, find_evidence
from advpipe.stages.investigate.investigation import (
    EpisodeRow,
    EvidenceRow,
    Investigation,
    NamedSuspect,
    missing_words,
)
from advpipe.stages.investigate.observations import PERIOD_NS
from advpipe.stages.investigate.registry import CUES
from advpipe.stages.investigate.situation import PriorKnowledge, read_situations
from advpipe.stages.investigate.suspicion import CumulativeSuspicion, LyingEpisode, SuspectRecord

__all__ = ["investigate"]

RELYING = frozenset(name for name, cue in CUES.items() if cue.relies_on_own_place)
"""Cues that a false GNSS makes contradict honest stations."""


def investigate(
    path: Path,
    *,
    vehicle: str | None = None,
    calibration: Calibration | None = None,
    silence_s: float | None = None,
) -> Investigation:
    """Who lied in a bag: each sensor and station with a probability, when it began, and the evidence.

    One pass over the allowed topics (`evidence_topics.py`), of which memory holds a tenth of a second.
    vehicle: whose evidence it is; `ego` or the only one without it. calibration: instead of the shipped one.
    silence_s: where stations change their pseudonyms, how long they fall silent at most before; a new id that
    continues a known station's way is then taken for it.
    Raises AdvpipeError for a bag that cannot be read, and UsageError for one with nothing to judge.
    """
    reader = BagReader(resolve_bag(path))
    topics = find_evidence(reader, vehicle)
    chosen = calibration or shipped_calibration()
    suspicion = CumulativeSuspicion(chosen, RELYING)
    readings, span_ns = judge_drive(reader, topics, suspicion, silence_s)
    if not sum(readings.values()):
        raise UsageError(f"{reader.path} has nothing to judge: no cue found two things to compare")
    return _answer(topics, chosen, suspicion, readings, span_ns)


def judge_drive(
    reader: BagReader,
    topics: EvidenceTopics,
    suspicion: CumulativeSuspicion,
    silence_s: float | None = None,
) -> tuple[Counter[str], tuple[int, int]]:
    """Let all cues judge a bag; returns how many readings each gave, and when the drive began and ended."""
    background = PriorKnowledge.of(reader, topics, silence_s)
    present = {name: cue(background) for name, cue in CUES.items() if all(map(topics.has, cue.needs))}
    counts: Counter[str] = Counter()
    first_ns = last_ns = 0
    spans = [reader.log_times_ns(name)[[0, -1]] for name in topics.kinds]
    periods = int(max(end for _, end in spans) - min(begin for begin, _ in spans)) // PERIOD_NS + 1
    for situation in track(read_situations(reader, topics, background), "investigating", periods):
        first_ns, last_ns = first_ns or situation.time_ns, situation.time_ns
        for name, cue in present.items():
            for reading in cue.judge(situation):
                counts[name] += 1
                suspicion.add(name, reading)
    return counts, (first_ns, last_ns)


def _answer(
    topics: EvidenceTopics,
    calibration: Calibration,
    suspicion: CumulativeSuspicion,
    readings: Counter[str],
    span_ns: tuple[int, int],
) -> Investigation:
    named, explained = suspicion.named()
    return Investigation(
        vehicle=topics.vehicle,
        start_ns=span_ns[0],
        duration_s=_rounded((span_ns[1] - span_ns[0]) / 1e9),
        suspects=tuple(_named(*each, calibration, span_ns[0]) for each in named),
        watched=suspicion.seen,
        unnamed=suspicion.unnamed,
        explained=tuple(suspect.name for suspect in explained),
        judged=tuple(name for name in CUES if readings[name]),
        not_judged=_not_judged(topics, readings),
    )


def _named(suspect: Suspect, record: SuspectRecord, calibration: Calibration, start_ns: int) -> NamedSuspect:
    episodes = tuple(_episode(one, calibration, start_ns) for one in record.episodes)
    surest = max(record.episodes, key=lambda one: one.probability)
    cue = max(surest.cue_share, key=lambda name: surest.cue_share[name])
    picture = next((one.picture for one in record.episodes if one.picture is not None), None)
    return NamedSuspect(
        suspect.name,
        suspect.station_id,
        max(one.probability for one in episodes),
        episodes[0].start_s,
        episodes[-1].end_s,
        surest.readings[cue][1].words,
        episodes,
        picture,
    )


def _episode(one: LyingEpisode, calibration: Calibration, start_ns: int) -> EpisodeRow:
    rows = {
        _row(cue, reading, calibration, start_ns): None
        for cue, both in one.readings.items()
        if cue in one.cue_share
        for reading in both
    }
    start_s, alarm_s, end_s = (
        _rounded((each_ns - start_ns) / 1e9) for each_ns in (one.start_ns, one.alarm_ns, one.end_ns)
    )
    return EpisodeRow(
        start_s,
        alarm_s,
        end_s,
        _rounded(one.probability),
        tuple(sorted(rows, key=lambda row: (row.time_s, row.cue))),
    )


def _row(cue: str, reading: CueReading, calibration: Calibration, start_ns: int) -> EvidenceRow:
    times = reading.value / calibration.cues[cue].limit
    return EvidenceRow(_rounded((reading.time_ns - start_ns) / 1e9), cue, _rounded(times), reading.words)


def _not_judged(topics: EvidenceTopics, readings: Mapping[str, int]) -> dict[str, str]:
    found = {}
    for name, cue in CUES.items():
        missing = [kind.value for kind in cue.needs if not topics.has(kind)]
        if missing:
            found[name] = f"{cue.meaning}: {missing_words(missing)}"
        elif not readings[name]:
            found[name] = f"{cue.meaning}: nothing in the bag could be compared"
    return found


def _rounded(number: float) -> float:
    return round(number, 4)
