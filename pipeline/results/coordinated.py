"""What `report.json` lists as `coordinated`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Flat, LeftOut, Listed


@dataclass(frozen=True)
class AttacksByTarget:
    """The attacks on a vehicle's fixes, messages, clouds, radar scans and camera images."""

    fixes: Annotated[tuple[str, ...] | None, LeftOut(), "names of the attacks on GNSS fixes"] = None
    messages: Annotated[tuple[str, ...] | None, LeftOut(), "names of the attacks on messages"] = None
    clouds: Annotated[tuple[str, ...] | None, LeftOut(), "names of the attacks on clouds"] = None
    scans: Annotated[tuple[str, ...] | None, LeftOut(), "names of the attacks on radar scans"] = None
    images: Annotated[tuple[str, ...] | None, LeftOut(), "names of the attacks on camera images"] = None


@dataclass(frozen=True)
class AttackedCounts:
    """How many fixes, messages, clouds, radar scans and camera images were attacked."""

    fixes: Annotated[int | None, LeftOut(), "number of attacked GNSS fixes"] = None
    messages: Annotated[int | None, LeftOut(), "number of attacked messages"] = None
    clouds: Annotated[int | None, LeftOut(), "number of attacked clouds"] = None
    scans: Annotated[int | None, LeftOut(), "number of attacked radar scans"] = None
    images: Annotated[int | None, LeftOut(), "number of attacked camera images"] = None


@dataclass(frozen=True)
class TogetherMetrics:
    """Means over the time in which all attacks are active, in seconds of the recording; None where a bag
    lacks the topic.

    own_place_m: the error of the vehicle's own position estimate. map_wrong: entries of its map that are
    false, missing or displaced. points_touched, objects_missed: in a cloud. returns_touched: in a scan.
    """

    from_s: Annotated[
        float, "beginning of the time in which all attacks are active, in seconds of the recording"
    ]
    to_s: Annotated[float, "end of that time, in seconds of the recording"]
    own_place_m_clean: Annotated[
        float | None, LeftOut(), "mean error of the vehicle's position estimate in the clean bag, in metres"
    ] = None
    own_place_m: Annotated[float | None, LeftOut(), "the same in the attacked bag, in metres"] = None
    map_wrong_clean: Annotated[
        float | None,
        LeftOut(),
        "mean number of false, missing and displaced entries of its Local Dynamic Map in the clean bag",
    ] = None
    map_wrong: Annotated[float | None, LeftOut(), "the same in the attacked bag"] = None
    points_touched_clean: Annotated[
        float | None, LeftOut(), "mean number of changed points per cloud in the clean bag: 0"
    ] = None
    points_touched: Annotated[float | None, LeftOut(), "the same in the attacked bag"] = None
    returns_touched_clean: Annotated[
        float | None, LeftOut(), "mean number of changed returns per attacked scan in the clean bag: 0"
    ] = None
    returns_touched: Annotated[float | None, LeftOut(), "the same in the attacked bag"] = None
    objects_missed_clean: Annotated[
        float | None,
        LeftOut(),
        "mean number of evaluated objects per cloud that the first detector misses in the clean bag",
    ] = None
    objects_missed: Annotated[float | None, LeftOut(), "the same in the attacked bag"] = None


@dataclass(frozen=True)
class CoordinatedRecord(Listed):
    """Attacks of several kinds on one vehicle in one bag; together: None where they never meet."""

    bag: Annotated[str, "adversarial bag"]
    vehicle: Annotated[str, "attacked vehicle"]
    attacks: Annotated[AttacksByTarget, "attacks on the vehicle, by what they change"]
    attacked: Annotated[AttackedCounts, Flat("attacked_")]
    together: Annotated[TogetherMetrics | None, Flat("")] = None
