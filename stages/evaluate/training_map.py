"""Whether the evaluated drive is on a map that a detector was trained on: the warning before all results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.training_maps import ReportsTrainingMaps, is_training_map, map_of


@dataclass(frozen=True)
class MapStatus:
    """Of one detector and one drive.

    is_training_map: None where that is unknown. text: what the reader has to know; empty for a map that the
    detector was not trained on.
    """

    is_training_map: bool | None
    text: str


def map_status(name: str, detector: ObjectDetector, clean: Mapping[str, str]) -> MapStatus:
    """What is known of a detector, named as `load_detector` takes it, and of a clean bag by its record."""
    map_sha256, short = map_of(clean), Path(name).name
    known = is_training_map(detector, map_sha256)
    if known:
        return MapStatus(
            True,
            f"Training map: the detector {short} was trained on drives on this map. Its figures here are "
            "better than on a map that it has not seen.",
        )
    if known is False:
        return MapStatus(False, "")
    listed = detector.training_maps_sha256 if isinstance(detector, ReportsTrainingMaps) else None
    if clean.get("source") and listed is not None:
        return MapStatus(
            None,
            f"Imported drive: {short} was trained on drives on {len(listed)} maps; this one names no map.",
        )
    if map_sha256 is None:
        reason = "the clean bag names no map"
    elif listed is None:
        reason = "the detector does not say which maps it was trained on"
    else:
        reason = "the detector does not know all maps that it was trained on"
    return MapStatus(
        None,
        f"Training map unknown: {short} may have been trained on drives on this map or not: {reason}.",
    )
