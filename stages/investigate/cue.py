"""What a cue is: one kind of contradiction, and how much of it a situation shows of whom."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import ClassVar, NamedTuple

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import PriorKnowledge, Situation


class Suspect(NamedTuple):
    """A sensor of the vehicle (`GNSS`, or the topic of a LiDAR), or a station by the id that it claims.

    station_id: None for a sensor.
    """

    name: str
    station_id: int | None = None


GNSS = Suspect("GNSS")


def station(station_id: int) -> Suspect:
    """The station that sends under this id."""
    return Suspect(f"station {station_id}", station_id)


class FreeSpacePicture(NamedTuple):
    """A claimed vehicle through which rays pass, seen from above in the frame of the vehicle.

    points_m: (P, 2) returns around it. rays_m: (R, 2) where rays return that pass through the claimed box,
    whose corners are corners_m (4, 2). origin_m: (2,) the LiDAR.
    """

    points_m: Float64
    rays_m: Float64
    corners_m: Float64
    origin_m: Float64


class CueReading(NamedTuple):
    """How implausible something is. value: 0 or more, compared with what honest ones reach
    (`calibration.py`). words: what contradicts what, a sentence without its subject."""

    suspect: Suspect
    time_ns: int
    value: float
    words: str
    picture: FreeSpacePicture | None = None


class Cue(ABC):
    """One cue with its memory of a drive.

    needs: without any of these topics it cannot judge. relies_on_own_place: whether a false GNSS makes it
    contradict honest stations. meaning: what it compares, for people.
    """

    needs: ClassVar[tuple[EvidenceKind, ...]]
    relies_on_own_place: ClassVar[bool] = False
    meaning: ClassVar[str]

    def __init__(self, background: PriorKnowledge) -> None:
        self._background = background

    @abstractmethod
    def judge(self, situation: Situation) -> Iterator[CueReading]:
        """Yield the readings of a situation; situations come in time order."""
