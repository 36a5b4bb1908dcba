"""What the viewer shows of one frame: points, boxes with their stories, and lines on the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.cloud_difference import CloudDifference, cloud_difference

Float64 = npt.NDArray[np.float64]

TRUTH, PREDICTION, CAM, LDM, CLAIM = "truth", "prediction", "cam", "ldm", "claim"
"""The role of a box: whose claim it is that something stands there. A claim is a position of debug topics."""

FOUND, DISPLACED, LOST, MISSED, IGNORED = "found", "displaced", "lost", "missed", "ignored"
"""What became of an object of the truth. Displaced: found strictly on the clean cloud, and only loosely on
the attacked one. Lost: not even that. Missed: not found on the clean cloud either. Ignored: not evaluated."""

CHANGED = "changed"
"""Of a received message: the attack created it, or changed its content."""

TRUE_POSITION, CLAIMED, BELIEVED_POSITION, WITHHELD = "true", "claimed", "believed", "withheld"
"""Of a claim: where the station is, where the attack puts it, where it believes to be, and where it is while
an attack drops or delays its message."""

HIT, FALSE = "hit", "false"
"""What a prediction is worth: it finds an object, or nothing. One of an ignored object is `IGNORED`."""

ALWAYS, CLEAN, ATTACKED = "", "clean", "attacked"
"""On which cloud a box is seen."""

LANE, TRUE_PATH, BELIEVED_PATH, CLAIM_LINE = "lane", "true", "believed", "claim"
"""Kinds of lines: lanes, paths, and those from a true position to what is claimed or believed."""


@dataclass(frozen=True)
class Fact:
    """A line of an object's story: one value, or one on each cloud."""

    name: str
    value: str
    attacked: str | None = None


@dataclass(frozen=True)
class SceneBox:
    """A box x, y, z (centre), length, width, height [m] and yaw [rad] in the LiDAR's frame, and its story.

    outcome: of a box of the truth or a prediction, one of those above. id: by which the same object is known
    in another frame; "" for none. group: the heading under which it stands in the list of objects.
    """

    role: str
    box: Sequence[float]
    title: str
    outcome: str = ""
    condition: str = ALWAYS
    id: str = ""
    group: str = ""
    lead: str = ""
    facts: tuple[Fact, ...] = ()


@dataclass(frozen=True)
class SceneLine:
    """A line (K, 3) on the ground, in metres in the LiDAR's frame."""

    kind: str
    places: Float64
    condition: str = ALWAYS


@dataclass(frozen=True)
class ViewerScene:
    """One frame, with the cloud that an attack made of it, if there is one.

    name: of a file that the picture is saved as. title: in one line what is seen. note: what the reader has
    to know about the picture. label: how a list of frames calls it.
    """

    name: str
    title: str
    clean: Cloud
    attacked: Cloud | None = None
    change: CloudDifference | None = None
    boxes: tuple[SceneBox, ...] = ()
    lines: tuple[SceneLine, ...] = ()
    note: str = ""
    label: str = ""

    @property
    def difference(self) -> CloudDifference:
        """What the attack did to the cloud; nothing without one."""
        if self.change is not None:
            return self.change
        if self.attacked is None:
            return cloud_difference(self.clean[:0], self.clean[:0])
        return cloud_difference(self.clean, self.attacked)


def object_title(class_name: str, id: str) -> str:
    """Such as `car parked.88`, or `pedestrian.76` where the id tells the class."""
    return id if id.startswith(class_name) else f"{class_name} {id}".strip()


def outcome_lead(outcome: str, min_score: float) -> str:
    """What became of an object of the truth, in a sentence; "" for one that is found or not evaluated."""
    return {
        DISPLACED: "Found strictly on the clean cloud, and only at loose overlap on the attacked one.",
        LOST: "Found on the clean cloud; on the attacked one no detection with a score of at least "
        f"{min_score:.2f} overlaps it enough.",
        MISSED: f"Not found with a score of at least {min_score:.2f} on the clean cloud.",
    }.get(outcome, "")


def prediction_box(
    box: Sequence[float], class_name: str, score: float, points: int, *, outcome: str, condition: str
) -> SceneBox:
    """A prediction on one cloud."""
    where = f" on the {condition} cloud" if condition else ""
    return SceneBox(
        PREDICTION,
        box,
        f"predicted {class_name}, {score:.2f}",
        outcome,
        condition,
        group=f"predictions{where}",
        facts=(
            Fact("score", f"{score:.2f}"),
            Fact("range", f"{math.hypot(box[0], box[1]):.1f} m"),
            Fact("LiDAR points", str(points)),
        ),
    )
