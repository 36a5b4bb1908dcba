"""What attacks did to camera images, as Parquet beside an adversarial bag: a row for each touched image and
attack."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.bounded_parquet import ColumnType
from advpipe.pipeline.labels.columns import Columns
from advpipe.pipeline.labels.optional_rows import optional_rows

FILE = "camera_labels.parquet"

DROPPED, DELAYED, REPLACED, PAINTED = "dropped", "delayed", "replaced", "painted"

EDGES = ("left_px", "top_px", "right_px", "bottom_px")

IMAGE_COLUMNS: Columns = {
    "topic": "string",
    "image": "int32",
    "stamp_ns": "int64",
    "attack": "string",
    "action": "string",
    "delay_ns": "int64",
    "source": "int32",
    **dict.fromkeys(EDGES, "int32"),
    "pixels": "int32",
    "target": "string",
}
"""topic: of the images; image: counts them in the clean bag; stamp_ns: there; attack: its name; action:
dropped, delayed, replaced or painted; delay_ns: by which it arrives late; source: the clean image that it
shows, of a replaced one; left_px to bottom_px: first and last column and row that were painted on; pixels:
how many in there; target: the road user that they belong to. What an action has no use for is null."""

_READ: dict[str, ColumnType] = {
    **dict.fromkeys(("topic", "attack", "action"), "text"),
    **dict.fromkeys(("image", "stamp_ns"), "whole"),
}


def read_image_labels(bag: Path) -> Iterator[dict[str, Any]]:
    """The rows of an adversarial bag, by topic, image, stamp, attack and action; none for a bag without
    attacks on cameras.

    bag: its folder, or the file in it. Raises AdvpipeError for a file that holds no such labels.
    """
    return optional_rows(bag, FILE, _READ, "camera")
