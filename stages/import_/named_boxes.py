"""Boxes whose classes a source names freely, such as text files and ROS messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.stages.import_.labelled import LabelledObject, sort_objects
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
    ours_of = {}
    for each in named:
        ours = class_map.get(each.class_name) or class_map.get(each.class_name.lower())
        if ours is None:
            raise AdvpipeError(
                f"the class {short_repr(each.class_name)} is unknown; say what it is with --class "
                f"NAME=CLASS, a CLASS of {', '.join((*CLASSES, IGNORED, DROPPED))}"
            )
        ours_of[each.class_name] = ours
    objects = [
        LabelledObject(each.class_name, each.id, tuple(each.box), tuple(each.velocity_mps)) for each in named
    ]
    found = sort_objects(objects, ours_of)
    return found.boxes, found.ignored
