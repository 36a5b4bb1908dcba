"""What `report.json` lists as `coordinated`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Flat, LeftOut, Listed


@dataclass(frozen=True)
class AttacksByTarget:
    """The attacks on a vehicle's fixes, messages and clouds."""

    fixes: Annotated[tuple[str, ...] | None, LeftOut()] = None
    messages: Annotated[tuple[str, ...] | None, LeftOut()] = None
    clouds: Annotated[tuple[str, ...] | None, LeftOut()] = None


@dataclass(frozen=True)
class AttackedCounts:
    """How many fixes, messages and clouds were attacked."""

    fixes: Annotated[int | None, LeftOut()] = None
    messages: Annotated[int | None, LeftOut()] = None
    clouds: Annotated[int | None, LeftOut()] = None


@dataclass(frozen=True)
class TogetherFigures:
    """Means over the time in which all attacks are active, in seconds of the recording; None where a bag
    lacks the topic.

    own_place_m: how far off the vehicle takes itself to be. map_wrong: stations of its map that are false,
    missing or displaced. points_touched: in a cloud.
    """

    from_s: float
    to_s: float
    own_place_m_clean: Annotated[float | None, LeftOut()] = None
    own_place_m: Annotated[float | None, LeftOut()] = None
    map_wrong_clean: Annotated[float | None, LeftOut()] = None
    map_wrong: Annotated[float | None, LeftOut()] = None
    points_touched_clean: Annotated[float | None, LeftOut()] = None
    points_touched: Annotated[float | None, LeftOut()] = None


@dataclass(frozen=True)
class CoordinatedRecord(Listed):
    """Attacks of two kinds or three on one vehicle in one bag; together: None where they never meet."""

    bag: str
    vehicle: str
    attacks: AttacksByTarget
    attacked: Annotated[AttackedCounts, Flat("attacked_")]
    together: Annotated[TogetherFigures | None, Flat("")] = None
