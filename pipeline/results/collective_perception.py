"""What `report.json` lists as `collective_perception`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Listed

_SHARE = "in [0, 1]"


@dataclass(frozen=True)
class CollectivePerceptionRecord(Listed):
    """What one vehicle knows of the road users that its own LiDARs do not see, from CAMs alone and with CPMs,
    and how often checks flag the objects that it hears of; NaN where there is nothing to count."""

    bag: Annotated[str, "`clean`, or an adversarial bag"]
    vehicle: Annotated[str, "the vehicle that receives"]
    instants: Annotated[int, "number of its recorded maps"]
    unseen: Annotated[int, "road users nearby with fewer than 5 LiDAR points, over all instants"]
    known_by_cams: Annotated[float, f"share of them that are in its map by CAMs, {_SHARE}"]
    known_with_cpms: Annotated[float, f"share of them that are in its map by CAMs or CPMs, {_SHARE}"]
    heard: Annotated[int, "objects that it has heard of nearby, over all instants"]
    heard_false: Annotated[float, f"share of them where there is no road user, {_SHARE}"]
    attacked: Annotated[int, "objects heard of that an attack added or changed"]
    free_space_tpr: Annotated[float, f"share of attacked objects in space that its LiDAR sees free, {_SHARE}"]
    free_space_fpr: Annotated[float, f"the same share of honest objects, {_SHARE}"]
    witnesses_tpr: Annotated[
        float, f"share of attacked objects that other stations nearby do not confirm, {_SHARE}"
    ]
    witnesses_fpr: Annotated[float, f"the same share of honest objects, {_SHARE}"]
    silent: Annotated[int, "reports that an attack took an object from, over all instants"]
    omission_tpr: Annotated[
        float, f"share of them that lack an object which its LiDAR and another station see, {_SHARE}"
    ]
    omission_fpr: Annotated[float, f"the same share of honest reports, {_SHARE}"]
