"""The objects of CPMs against the CAMs of the vehicles that they are of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from advpipe.pipeline.misbehaviour.checks import claimed_box, velocity_mps
from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject
from advpipe.stages.investigate.cue import Cue, CueReading, station
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import Situation

SAME_M, SAME_MPS = 8.0, 1.5
"""An object so near to a claimed vehicle, and about as fast, is taken for it."""


class CpmObjectsCue(Cue):
    """The median distance between a station's objects and the claimed places of the vehicles that they are.

    An object of which no CAM tells is no cue: not all vehicles send any.
    """

    needs = (EvidenceKind.MESSAGES,)
    meaning = "objects in CPMs against the CAMs of the same vehicles"

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        by_station: dict[int, list[HeardObject]] = {}
        for one in situation.heard:
            by_station.setdefault(one.station_id, []).append(one)
        for number, objects in by_station.items():
            apart_m = [away for one in objects if (away := _apart_m(one, situation.around)) is not None]
            if apart_m:
                middle_m = float(np.median(apart_m))
                words = f"its CPM puts vehicles {middle_m:.1f} m beside where their own CAMs do"
                yield CueReading(station(number), situation.time_ns, middle_m, words)


def _apart_m(one: HeardObject, around: Mapping[int, Claim]) -> float | None:
    """From the nearest claimed vehicle that moves alike; None without any."""
    found = []
    for number, claim in around.items():
        box = claimed_box(claim, one.measured_ns)
        if number == one.station_id or box is None:
            continue
        (x_mps, y_mps), (object_x_mps, object_y_mps) = velocity_mps(claim), one.velocity_mps
        away_m = math.hypot(one.centre_m[0] - box[0], one.centre_m[1] - box[1])
        if away_m <= SAME_M and math.hypot(x_mps - object_x_mps, y_mps - object_y_mps) <= SAME_MPS:
            found.append(away_m)
    return min(found, default=None)
