"""Boxes whose classes a source names freely, such as text files and ROS messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.stages.import_.options import DROPPED, IGNORED

USUAL_CLASSES: Mapping[str, str] = {
    **{name: name for name in CLASSES},
    **dict.fromkeys(("vehicle", "car_sedan", "suv", "taxi"), "car"),
    **dict.fromkeys(("van", "bus", "tram", "trailer", "lorry", "construction_vehicle"), "truck"),
    **dict.fromkeys(("motorcycle", "motorbike", "motorcyclist", "bicycle", "bike", "rider"), "cyclist"),
    **dict.fromkeys(("person", "walker", "people", "adult", "child"), "pedestrian"),
    **dict.fromkeys(("unknown", "misc", "other", "other_vehicle", "dontcare", "ignore"), IGNORED),
    **dict.fromkeys(("animal", "hazard", "sign", "barrier", "traffic_cone", "over_drivable"), DROPPED),
}
"""Common names in lower case, and our classes."""


class NamedBox(NamedTuple):
    """box: columns `BOX_COLUMNS`. id: "" where unknown. velocity_mps: (3,), NaN where unknown."""

    class_name: str
    box: Sequence[float]
    id: str = ""
    velocity_mps: Sequence[float] = (np.nan, np.nan, np.nan)


def sort_named_boxes(named: Sequence[NamedBox], class_map: Mapping[str, str]) -> tuple[Boxes, IgnoredBoxes]:
    """Those that count and those that count neither way; dropped ones are left out.

    Raises AdvpipeError for a class that the map lacks in the source's spelling and in lower case.
    """
    counted: list[NamedBox] = []
    ignored: list[NamedBox] = []
    labels: list[int] = []
    for each in named:
        ours = class_map.get(each.class_name) or class_map.get(each.class_name.lower())
        if ours is None:
            raise AdvpipeError(
                f"the class {short_repr(each.class_name)} is unknown; say what it is with --class "
                f"NAME=CLASS, a CLASS of {', '.join((*CLASSES, IGNORED, DROPPED))}"
            )
        if ours == IGNORED:
            ignored.append(each)
        elif ours != DROPPED:
            counted.append(each)
            labels.append(CLASSES.index(ours))
    velocities = np.array([each.velocity_mps for each in counted], np.float64).reshape(-1, 3)
    ids, ignored_ids = tuple(each.id for each in counted), tuple(each.id for each in ignored)
    return (
        Boxes(_geometry(counted), np.array(labels, np.int64), ids, velocities),
        IgnoredBoxes(_geometry(ignored), tuple(each.class_name for each in ignored), ignored_ids),
    )


def _geometry(named: Sequence[NamedBox]) -> Float64:
    return np.array([each.box for each in named], np.float64).reshape(-1, 7)
