"""Which units of an adversarial bag an attack touched, from the tables beside it; nothing of a clean one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from advpipe.pipeline.audit.roc_area import Int64
from advpipe.pipeline.core.bounded_parquet import flat_columns, rows
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels import fixes, images, scans
from advpipe.pipeline.labels.clouds import FRAMES, POINTS, read_point_labels
from advpipe.pipeline.labels.messages import DROPPED, read_labels
from advpipe.pipeline.labels.points import REMOVED, PointLabels

Place = tuple[str, int]
"""A topic, or a vehicle, and a stamp in nanoseconds."""


@dataclass(frozen=True)
class TouchedUnits:
    """What attacks touched besides clouds.

    messages: numbers in /v2x/sent. fixes: by vehicle. images: by topic, those that arrive. returns: the
    touched returns of each radar scan, by index there.
    """

    messages: frozenset[int] = frozenset()
    fixes: frozenset[Place] = frozenset()
    images: frozenset[Place] = frozenset()
    returns: Mapping[Place, Int64] = field(default_factory=dict)

    @classmethod
    def read(cls, bag: Path) -> TouchedUnits:
        """From the tables in a bag's folder. Raises AdvpipeError for a damaged one."""
        messages = {label.number for label in read_labels(bag) if label.action != DROPPED}
        return cls(frozenset(messages), _fixes(bag), _images(bag), _returns(bag))


def touched_clouds(bag: Path, topic: str) -> Iterator[tuple[int, PointLabels | None]]:
    """For each cloud of a topic, in order: its stamp, and the labels of its touched points, None for one that
    no attack touched; nothing for a bag or a topic without such labels.

    Memory holds the labels of one cloud. Raises AdvpipeError for a damaged table.
    """
    folder = bag if bag.is_dir() else bag.parent
    if not ((folder / POINTS).is_file() and (folder / FRAMES).is_file()):
        return
    labels = (each for each in read_point_labels(folder / POINTS) if each.topic == topic)
    following = next(labels, None)
    for row in rows(folder / FRAMES, ["topic", "frame", "stamp_ns", "points_clean"]):
        if row["topic"] != topic:
            continue
        if following is None or following.frame != row["frame"]:
            yield row["stamp_ns"], None
            continue
        known = following.labels.point
        if ((known < -1) | (known >= row["points_clean"])).any():
            raise AdvpipeError(f"{folder / POINTS}: labels a point that frame {row['frame']} does not have")
        yield row["stamp_ns"], following.labels
        following = next(labels, None)


def touched_points(labels: PointLabels, clean: int, here: int) -> Int64:
    """The moved and added points of a cloud of `here` points, by index; clean: how many it had. Raises
    AdvpipeError for labels of other points."""
    if clean < 0 or (labels.point >= clean).any():
        raise AdvpipeError(f"{POINTS}: labels a point that the cloud did not have")
    found: Int64 = labels.places(clean)[labels.action != REMOVED]
    if ((found < 0) | (found >= here)).any():
        raise AdvpipeError(f"{POINTS}: labels a point that the cloud does not have")
    return found


def _fixes(bag: Path) -> frozenset[Place]:
    path = bag / fixes.FILE
    if not path.is_file():
        return frozenset()
    found = rows(path, ["vehicle", "stamp_ns", "attack"])
    return frozenset((row["vehicle"], row["stamp_ns"]) for row in found if row["attack"])


def _images(bag: Path) -> frozenset[Place]:
    found = list(images.read_image_labels(bag))
    lost = {(row["topic"], row["image"]) for row in found if row["action"] == images.DROPPED}
    return frozenset(
        (row["topic"], row["stamp_ns"]) for row in found if (row["topic"], row["image"]) not in lost
    )


def _returns(bag: Path) -> dict[Place, Int64]:
    path = bag / scans.FILE
    if not path.is_file() or "attacked" not in flat_columns(path):
        return {}
    found: dict[Place, list[int]] = defaultdict(list)
    for row in rows(path, ["topic", "stamp_ns", "attacked"]):
        places = found[row["topic"], row["stamp_ns"]]
        if row["attacked"] is not None:
            places.append(row["attacked"])
    return {place: np.array(own, np.int64) for place, own in found.items()}
