"""Adds up what speaks against each suspect: cumulative sums that forget, and a probability of all of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from advpipe.stages.investigate.calibration import Calibration
from advpipe.stages.investigate.cue import GNSS, CueReading, FreeSpacePicture, Suspect

FORGET_S = 30.0
"""A suspect of whom nothing was read for longer is forgotten, unless it has been named."""

MOST_NAMED = 500
"""A flood can claim any number of ids; the first ones are named, and the others counted."""

MOST_EPISODES = 50
EXPLAINED_NS = 3_000_000_000
"""A false GNSS explains what began so long before it was noticed, or after it ended."""

QUIET = 0.3
"""An episode ends when the probability has fallen below this share of the alarm's."""

NOTABLE = 0.2
"""A cue whose share of the evidence is smaller does not say when it began, unless all are."""


@dataclass
class CueScore:
    """The score of a cue against a suspect. onset_ns: when it last rose from zero. first, strongest: the
    readings above the limit since then."""

    score: float = 0.0
    time_ns: int = 0
    onset_ns: int = 0
    first: CueReading | None = None
    strongest: CueReading | None = None


@dataclass
class LyingEpisode:
    """A time in which a suspect lies, as far as the evidence goes. alarm_ns: when it was sure enough.
    strongest: by cue, the first and the strongest reading; cue_share: by cue, of the evidence at its peak."""

    start_ns: int
    alarm_ns: int
    end_ns: int
    probability: float
    readings: dict[str, tuple[CueReading, CueReading]] = field(default_factory=dict)
    cue_share: dict[str, float] = field(default_factory=dict)

    @property
    def picture(self) -> FreeSpacePicture | None:
        """The picture of the strongest reading that has one."""
        with_one = [last for _, last in self.readings.values() if last.picture is not None]
        return max(with_one, key=lambda one: one.value).picture if with_one else None


@dataclass
class SuspectRecord:
    """All about one suspect."""

    scores: dict[str, CueScore] = field(default_factory=dict)
    last_ns: int = 0
    probability: float = 0.0
    peak: float = 0.0
    peak_scores: dict[str, float] = field(default_factory=dict)
    episodes: list[LyingEpisode] = field(default_factory=list)
    is_lying: bool = False


class CumulativeSuspicion:
    """Keeps the record of each suspect, of which memory stays flat. relying: names of the cues that a false
    GNSS makes contradict honest stations; while the GNSS lies, they are not heard.

    Each cue has a cumulative sum against each suspect (Page 1954, "Continuous inspection schemes"): it rises
    by readings above what honest ones reach, falls by others, and never below zero; and it fades with time.
    """

    def __init__(self, calibration: Calibration, relying: Collection[str] = ()) -> None:
        self._calibration, self._relying = calibration, frozenset(relying)
        self.records: dict[Suspect, SuspectRecord] = {}
        self.seen = 0
        self.unnamed = 0
        self._swept_ns = 0

    def add(self, cue: str, reading: CueReading) -> None:
        """Take in a reading; those of a suspect come in time order, but for fractions of a second."""
        gnss = self.records.get(GNSS)
        if gnss is not None and gnss.is_lying and cue in self._relying:
            return
        self._forget(reading.time_ns)
        record = self.records.get(reading.suspect)
        if record is None:
            record = self.records[reading.suspect] = SuspectRecord()
            self.seen += 1
        score = record.scores.setdefault(cue, CueScore(time_ns=reading.time_ns, onset_ns=reading.time_ns))
        self._update(score, cue, reading)
        record.last_ns = max(record.last_ns, reading.time_ns)
        self._judge(record, reading)

    def _update(self, score: CueScore, cue: str, reading: CueReading) -> None:
        one = self._calibration
        elapsed_s = max(reading.time_ns - score.time_ns, 0) / 1e9
        before = score.score * 0.5 ** (elapsed_s / one.half_life_s)
        step = one.step(cue, reading.value)
        if before < one.least and step > 0:
            score.onset_ns, score.first, score.strongest = reading.time_ns, reading, reading
        elif step > 0 and (score.strongest is None or reading.value >= score.strongest.value):
            score.strongest = reading
        score.score = min(max(before + step, 0.0), one.ceiling)
        score.time_ns = reading.time_ns

    def _judge(self, record: SuspectRecord, reading: CueReading) -> None:
        one, now_ns = self._calibration, reading.time_ns
        faded = {
            cue: score.score * 0.5 ** (max(now_ns - score.time_ns, 0) / 1e9 / one.half_life_s)
            for cue, score in record.scores.items()
        }
        record.probability = one.probability(faded)
        if record.probability > record.peak:
            record.peak, record.peak_scores = record.probability, faded
        if record.probability >= one.alarm_probability:
            if not record.is_lying:
                self._begin(record, faded, now_ns)
            if record.is_lying:
                self._continue(record, faded, now_ns)
        elif record.is_lying and record.probability < QUIET * one.alarm_probability:
            record.is_lying = False

    def _begin(self, record: SuspectRecord, faded: Mapping[str, float], now_ns: int) -> None:
        if not record.episodes and sum(bool(each.episodes) for each in self.records.values()) >= MOST_NAMED:
            self.unnamed += 1
            return
        shares = self._shares(faded)
        notable = min(NOTABLE, max(shares.values(), default=0.0) / 2)
        onsets_ns = (record.scores[cue].onset_ns for cue, share in shares.items() if share >= notable)
        start_ns = min(onsets_ns, default=now_ns)
        if record.episodes:
            start_ns = max(start_ns, record.episodes[-1].end_ns)
        record.is_lying = True
        if len(record.episodes) < MOST_EPISODES:
            record.episodes.append(LyingEpisode(start_ns, now_ns, now_ns, 0.0))

    def _continue(self, record: SuspectRecord, faded: Mapping[str, float], now_ns: int) -> None:
        episode = record.episodes[-1]
        episode.end_ns = max(episode.end_ns, now_ns)
        if record.probability >= episode.probability:
            episode.probability, episode.cue_share = record.probability, self._shares(faded)
        for cue, score in record.scores.items():
            if faded[cue] > 0 and score.first is not None and score.strongest is not None:
                first, strongest = episode.readings.get(cue, (score.first, score.strongest))
                last = score.strongest if score.strongest.value > strongest.value else strongest
                episode.readings[cue] = (first, last)

    def _shares(self, faded: Mapping[str, float]) -> dict[str, float]:
        """Each cue's share of the evidence."""
        parts = {cue: self._calibration.cues[cue].weight * score for cue, score in faded.items()}
        whole = sum(parts.values())
        return {cue: part / whole for cue, part in parts.items() if part > 0}

    def _forget(self, now_ns: int) -> None:
        """Drop those of whom nothing was read for long, and who were never named."""
        if now_ns - self._swept_ns < FORGET_S * 1e9 / 4:
            return
        self._swept_ns = now_ns
        for suspect, record in list(self.records.items()):
            if now_ns - record.last_ns > FORGET_S * 1e9:
                if not record.episodes:
                    del self.records[suspect]
                record.scores.clear()
                record.is_lying = False

    def named(self) -> tuple[list[tuple[Suspect, SuspectRecord]], list[Suspect]]:
        """Those with an episode, the surest first; and apart those of whom a false GNSS explains all."""
        found = [(who, one) for who, one in self.records.items() if one.episodes]
        found.sort(key=lambda each: (-each[1].peak, each[1].episodes[0].start_ns, each[0].name))
        gnss = self.records.get(GNSS)
        false = [] if gnss is None else gnss.episodes
        explained = [who for who, one in found if who != GNSS and self._is_explained(one, false)]
        return [each for each in found if each[0] not in explained], explained

    def _is_explained(self, record: SuspectRecord, false: Sequence[LyingEpisode]) -> bool:
        """Whether the episodes of a false GNSS hold all of another suspect's: all that speaks against that
        suspect depends on where the vehicle is."""
        return all(
            set(episode.cue_share) <= self._relying
            and any(
                each.start_ns - EXPLAINED_NS <= episode.start_ns <= each.end_ns + EXPLAINED_NS
                for each in false
            )
            for episode in record.episodes
        )
