"""tracklet_labels.xml: the objects of a raw drive."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from advpipe.pipeline.core.document import read_text
from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.geometry.transforms import Float64

_LARGEST_BYTES = 1 << 27
_FIX = "restore it from the drive's tracklet archive, or remove it to import without labels"


@dataclass(frozen=True)
class Tracklet:
    """One object over frames that follow one another.

    number: place in the file. class_name: as the object benchmark writes it. boxes: (K, 7) in the LiDAR's
    frame, upright there. occlusion: of each frame, 0 to 2, -1 where it was not set.
    """

    number: int
    class_name: str
    first_frame: int
    boxes: Float64
    occlusion: tuple[int, ...]

    @property
    def id(self) -> str:
        """A name that no other object of the drive has."""
        return f"tracklet_{self.number}"

    def place(self, frame: int) -> int | None:
        """The row of `boxes` at a frame; None where the object is not there."""
        place = frame - self.first_frame
        return place if 0 <= place < len(self.boxes) else None


def read_tracklets(file: Path) -> list[Tracklet]:
    """Read all tracklets. Raises AdvpipeError, one line, for a damaged file."""
    text = read_text(file, _LARGEST_BYTES)
    if "<!ENTITY" in text:  # a few of them can expand to gigabytes
        raise AdvpipeError(f"{file}: declares entities, which KITTI's files do not; {_FIX}")
    try:
        root = ElementTree.fromstring(text)
        return [_tracklet(number, item) for number, item in enumerate(root.findall("tracklets/item"))]
    except (ElementTree.ParseError, ValueError, AttributeError, TypeError) as error:
        raise AdvpipeError(one_line(f"{file}: is no valid tracklet_labels.xml ({error}); {_FIX}")) from None


def _tracklet(number: int, item: ElementTree.Element) -> Tracklet:
    class_name = item.findtext("objectType", "").strip().replace(" (sitting)", "_sitting")
    if not class_name:
        raise ValueError(f"tracklet {number} has no objectType")
    height_m, width_m, length_m = (_number(item, key) for key in ("h", "w", "l"))
    poses = item.findall("poses/item")
    boxes = [
        (
            _number(pose, "tx"),
            _number(pose, "ty"),
            _number(pose, "tz") + height_m / 2,  # tz is that of the bottom face
            length_m,
            width_m,
            height_m,
            _number(pose, "rz"),
        )
        for pose in poses
    ]
    occlusion = tuple(int(float(pose.findtext("occlusion", "-1"))) for pose in poses)
    first_frame = int(_number(item, "first_frame"))
    return Tracklet(number, class_name, first_frame, np.array(boxes, np.float64).reshape(-1, 7), occlusion)


def _number(item: ElementTree.Element, key: str) -> float:
    text = item.findtext(key)
    if text is None:
        raise ValueError(f"an item has no {key}")
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{key} is {text}")
    return value


def at_frame(tracklets: list[Tracklet], frame: int) -> Iterator[tuple[Tracklet, int]]:
    """The objects that are there at a frame, each with its row of `boxes`."""
    for tracklet in tracklets:
        place = tracklet.place(frame)
        if place is not None:
            yield tracklet, place
