"""Labelled objects of a source, sorted into those that count, those that count neither way, and the rest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.stages.import_.options import DROPPED, IGNORED

NO_VELOCITY = (np.nan, np.nan, np.nan)


class LabelledObject(NamedTuple):
    """One labelled object. box: columns `BOX_COLUMNS`. lidar_points: as the source counts them."""

    class_name: str
    id: str
    box: tuple[float, ...]
    velocity_mps: tuple[float, ...] = NO_VELOCITY
    lidar_points: int = 0


@dataclass(frozen=True)
class SortedObjects:
    """lidar_points: (M,), of the M boxes."""

    boxes: Boxes = field(default_factory=Boxes)
    ignored: IgnoredBoxes = field(default_factory=IgnoredBoxes)
    lidar_points: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))


def sort_objects(
    objects: Iterable[LabelledObject], class_map: Mapping[str, str], default: str = IGNORED
) -> SortedObjects:
    """Sort objects by what the class map says.

    A name `class/attribute` follows its own entry, else that of `class`; one without an entry is `default`.
    """
    counted: list[LabelledObject] = []
    labels: list[int] = []
    ignored: list[LabelledObject] = []
    for each in objects:
        ours = class_map.get(each.class_name, class_map.get(each.class_name.partition("/")[0], default))
        if ours == IGNORED:
            ignored.append(each)
        elif ours != DROPPED:
            counted.append(each)
            labels.append(CLASSES.index(ours))
    boxes = Boxes(
        _geometry(counted),
        np.array(labels, np.int64),
        tuple(each.id for each in counted),
        np.array([each.velocity_mps for each in counted], np.float64).reshape(-1, 3),
    )
    return SortedObjects(
        boxes,
        IgnoredBoxes(
            _geometry(ignored),
            tuple(each.class_name for each in ignored),
            tuple(each.id for each in ignored),
        ),
        np.array([each.lidar_points for each in counted], np.int64),
    )


def track_velocities(
    stamps_ns: npt.ArrayLike, positions_m: npt.ArrayLike, longest_gap_s: float = 1.5
) -> Float64:
    """Velocities (K, 3) of an object seen at K ascending times, by the rule of nuScenes' development kit.

    The centred difference of the neighbours, at the ends that to the only one. NaN for a single position, and
    where the neighbours are further apart than `longest_gap_s` (twice that for a centred difference).
    positions_m: (K, 3). Source: `NuScenes.box_velocity`, nuscenes-devkit 1.2.
    """
    stamps = np.asarray(stamps_ns, np.int64)
    positions = np.asarray(positions_m, np.float64).reshape(-1, 3)
    at = np.arange(len(stamps))
    first, last = np.maximum(at - 1, 0), np.minimum(at + 1, len(stamps) - 1)
    elapsed_s = (stamps[last] - stamps[first]) / 1e9
    longest_s = longest_gap_s * np.where((first < at) & (last > at), 2.0, 1.0)
    velocities = np.full_like(positions, np.nan)
    known = (elapsed_s > 0) & (elapsed_s <= longest_s)
    velocities[known] = (positions[last] - positions[first])[known] / elapsed_s[known, None]
    return velocities


def _geometry(objects: Sequence[LabelledObject]) -> Float64:
    return np.array([each.box for each in objects], np.float64).reshape(-1, 7)
