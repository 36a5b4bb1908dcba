"""The answer: who lied, from when to when, about what, how sure that is, and what shows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted
from advpipe.stages.investigate.cue import FreeSpacePicture


@dataclass(frozen=True)
class EvidenceRow:
    """One thing that contradicts another. time_s: since the first observation. times_limit: how many times
    what honest ones reach."""

    time_s: float
    cue: str
    times_limit: float
    words: str


@dataclass(frozen=True)
class EpisodeRow:
    """A time in which a suspect lies; times since the first observation. alarm_s: when it was sure enough."""

    start_s: float
    alarm_s: float
    end_s: float
    probability: float
    evidence: tuple[EvidenceRow, ...]


@dataclass(frozen=True)
class NamedSuspect:
    """Who lied. station_id: None for a sensor. probability: the highest of its episodes. about: what its
    strongest evidence contradicts. picture: of the ray that passes through a claimed vehicle, if one does."""

    name: str
    station_id: int | None
    probability: float
    start_s: float
    end_s: float
    about: str
    episodes: tuple[EpisodeRow, ...]
    picture: FreeSpacePicture | None = field(default=None, repr=False, compare=False)

    def __str__(self) -> str:
        first = self.episodes[0]
        return (
            f"{self.name} lies from {self.start_s:.1f} to {self.end_s:.1f} s "
            f"({100 * self.probability:.0f} %, clear at {first.alarm_s:.1f} s): {self.about}"
        )


@dataclass(frozen=True)
class Investigation(Tabular):
    """What an investigation of one vehicle's drive found.

    vehicle: "" for an unnamed one. suspects: the surest first. watched: sensors and stations on whom any cue
    had anything to say. unnamed: further ones, beyond the most that are named. explained: stations that a
    false GNSS makes look false. not_judged: by cue, why it could not judge.
    """

    vehicle: str
    start_ns: int
    duration_s: float
    suspects: tuple[NamedSuspect, ...]
    watched: int
    unnamed: int
    explained: tuple[str, ...]
    judged: tuple[str, ...]
    not_judged: Mapping[str, str]

    def __str__(self) -> str:
        outcome = counted(len(self.suspects) + self.unnamed, "suspect") if self.suspects else "nobody lied"
        return f"{outcome} among {self.watched:,} watched in {self.duration_s:.1f} s"

    def to_dicts(self) -> Rows:
        """A row for each episode of each suspect."""
        return [
            {
                "suspect": one.name,
                "station_id": one.station_id,
                **{name: value for name, value in asdict(episode).items() if name != "evidence"},
                "about": one.about,
            }
            for one in self.suspects
            for episode in one.episodes
        ]

    def to_plain(self) -> dict[str, Any]:
        """The answer for JSON, without pictures."""
        return {
            "vehicle": self.vehicle,
            "start_ns": self.start_ns,
            "duration_s": self.duration_s,
            "watched": self.watched,
            "unnamed": self.unnamed,
            "suspects": [_plain(one) for one in self.suspects],
            "explained_by_gnss": list(self.explained),
            "judged": list(self.judged),
            "not_judged": dict(self.not_judged),
        }


def _plain(one: NamedSuspect) -> dict[str, Any]:
    return {
        "name": one.name,
        "station_id": one.station_id,
        "probability": one.probability,
        "start_s": one.start_s,
        "end_s": one.end_s,
        "about": one.about,
        "episodes": [asdict(episode) for episode in one.episodes],
    }


def missing_words(needs: Sequence[str]) -> str:
    """Why a cue could not judge, such as `the bag has no GNSS fixes and no lanes`."""
    return "the bag has " + " and ".join(f"no {need.removeprefix('an ')}" for need in needs)
