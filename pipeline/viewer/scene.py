"""What the viewer shows of one frame: points, boxes with their stories, and lines on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.messages.cloud_difference import CloudDifference, cloud_difference

Float64 = npt.NDArray[np.float64]

TRUTH, PREDICTION, CAM, LDM = "truth", "prediction", "cam", "ldm"
"""The role of a box: whose claim it is that something stands there."""

FOUND, DISPLACED, LOST, MISSED, IGNORED = "found", "displaced", "lost", "missed", "ignored"
"""What became of an object of the truth. Displaced: found strictly on the clean cloud, and only loosely on
the attacked one. Lost: not even that. Missed: not found on the clean cloud either. Ignored: not evaluated."""

CHANGED = "changed"
"""Of a received message: the attack created it, or changed its content."""

HIT, FALSE = "hit", "false"
"""What a prediction is worth: it finds an object, or nothing. One of an ignored object is `IGNORED`."""

ALWAYS, CLEAN, ATTACKED = "", "clean", "attacked"
"""On which cloud a box is seen."""

LANE, TRUE_PATH, BELIEVED_PATH = "lane", "true", "believed"
"""Kinds of lines on the ground."""


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
