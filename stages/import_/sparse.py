"""Clouds with far fewer points than their neighbours, as a file has that was truncated between two points."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from advpipe.pipeline.core.document import Document

FEW = 0.5
"""Of the points of the neighbours."""

_REACH, _LEAST = 5, 2
"""How many clouds before and after one are its neighbours, and how many it needs at least."""


class CloudSize(Document):
    """How many points a cloud has. lidar: its vehicle and name. frame: as errors call it."""

    lidar: str
    frame: str
    points: int


def sparse_clouds(sizes: Iterable[CloudSize]) -> Iterator[str]:
    """A sentence for each LiDAR with such clouds; sizes: in time order."""
    by_lidar: dict[str, list[CloudSize]] = defaultdict(list)
    for each in sizes:
        by_lidar[each.lidar].append(each)
    for lidar, clouds in by_lidar.items():
        usual = [_usual([each.points for each in clouds], place) for place in range(len(clouds))]
        sparse = [k for k, each in enumerate(clouds) if each.points < FEW * usual[k]]
        if sparse:
            first = clouds[sparse[0]]
            yield (
                f"{len(sparse)} of {len(clouds)} clouds of {lidar} have less than half of the points of "
                f"their neighbours, such as {first.frame}: {first.points:,} of some {usual[sparse[0]]:,.0f}; "
                "their files may be truncated."
            )


def _usual(points: Sequence[int], place: int) -> float:
    """The median of the neighbours; 0 for too few of them."""
    near = [*points[max(0, place - _REACH) : place], *points[place + 1 : place + 1 + _REACH]]
    return float(np.median(near)) if len(near) >= _LEAST else 0.0
