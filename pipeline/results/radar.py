"""What `report.json` lists as `radar` and `radar_detection`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Listed


@dataclass(frozen=True)
class RadarRecord(Listed):
    """One radar in one adversarial bag. random: as many returns of each scan removed and added at random."""

    bag: Annotated[str, "adversarial bag"]
    vehicle: Annotated[str, "vehicle that carries the radar"]
    radar: Annotated[str, "name of the radar"]
    attacks: Annotated[tuple[str, ...], "names of the attacks that touched its scans"]
    scans: Annotated[int, "number of scans"]
    attacked_scans: Annotated[int, "number of scans that an attack touched; figures below are of these"]
    added: Annotated[float, "returns added to an attacked scan, on average"]
    changed: Annotated[float, "returns of an attacked scan changed, on average"]
    removed: Annotated[float, "returns removed from an attacked scan, on average"]
    returns_clean: Annotated[float, "returns of a scan in the clean bag, on average"]
    returns: Annotated[float, "the same in the attacked bag"]
    ghosts_clean: Annotated[
        float, "moving returns of a scan that are at no road user, on average, in the clean bag"
    ]
    ghosts: Annotated[float, "the same in the attacked bag"]
    ghosts_random: Annotated[float, "the same of the random baseline"]


@dataclass(frozen=True)
class RadarDetectionRecord(Listed):
    """Road users in view of one radar, in the attacked scans, of a class and a range. One is detected in a
    scan with at least one return at its box."""

    bag: Annotated[str, "adversarial bag"]
    vehicle: Annotated[str, "vehicle that carries the radar"]
    radar: Annotated[str, "name of the radar"]
    class_name: Annotated[str, "class of road users; `all` for every class"]
    range: Annotated[str, "range of distances from the radar, in metres; `all` for every distance"]
    objects: Annotated[int, "number of road users in view, in all attacked scans together"]
    detected_clean: Annotated[int, "number of these that are detected in the clean bag"]
    detected: Annotated[int, "the same in the attacked bag"]
    detected_random: Annotated[int, "the same of the random baseline"]
    lost: Annotated[int, "number of those detected in the clean bag that are not in the attacked bag"]
    lost_percent: Annotated[float, "lost in percent of detected_clean"]
    lost_random_percent: Annotated[float, "the same of the random baseline, in percent"]
