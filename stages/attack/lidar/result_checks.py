"""Checks of the results of attacks, which a user may have written: an invalid one is refused in one line."""

from __future__ import annotations

from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.points import ACTIONS, PointLabels
from advpipe.pipeline.labels.quantity import excesses
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, chosen_points
from advpipe.stages.attack.lidar.base import LidarAttack, LidarResult

_DTYPE_KINDS = {"point": "iu", "action": "U", "displacement_m": "f"}
"""The arrays of `PointLabels`, by the kinds of their numbers as numpy calls them."""


def refuse_invalid(attack: str, clean: Cloud, result: Any) -> None:
    """Raises AdvpipeError for an invalid result, and for labels that do not match the change."""
    if not isinstance(result, LidarResult):
        raise AdvpipeError(f"{attack} returned {type(result).__name__}, not a LidarResult")
    cloud = result.cloud
    if not isinstance(cloud, np.ndarray) or cloud.dtype != POINT_DTYPE or cloud.ndim != 1:
        fields = ", ".join(POINT_DTYPE.names or ())
        raise AdvpipeError(
            f"{attack} returned {_description(cloud)} as its cloud, not points (N,) of {fields}"
        )
    _refuse_labels(attack, result.labels, len(clean))
    removed, added = int(result.labels.is_removed.sum()), int(result.labels.is_added.sum())
    if len(cloud) != len(clean) - removed + added:
        raise AdvpipeError(
            f"{attack} made {len(clean)} points {len(cloud)}, but labels {removed} as removed and "
            f"{added} as added"
        )
    if _has_unlabelled_changes(clean, cloud, result.labels):
        raise AdvpipeError(
            f"{attack} changed points without labels; the points that it keeps stay in their "
            "order, and those that it adds follow"
        )
    for name in ("loss_before", "loss_after"):
        if not isinstance(getattr(result, name), int | float | np.number):
            raise AdvpipeError(f"{attack} returned {getattr(result, name)!r} as its {name}, not a number")
    if not isinstance(result.note, str):
        raise AdvpipeError(f"{attack} returned {result.note!r} as its note, not text")


def refuse_out_of_bounds(name: str, attack: LidarAttack, clean: Cloud, result: LidarResult) -> None:
    """Raises AdvpipeError where an attack went beyond the bounds that it declares."""
    if len(result.labels):
        change = CloudChange(clean, result.cloud, result.labels)
        for excess in excesses(change, attack.bounds, attack.measurable()):
            raise AdvpipeError(f"{name} went beyond its bounds: {excess}")


def _has_unlabelled_changes(clean: Cloud, cloud: Cloud, labels: PointLabels) -> bool:
    """Whether a point differs and has no label; bytes are compared, so that NaN equals itself."""
    kept, labelled = np.ones(len(clean), bool), np.zeros(len(clean), bool)
    kept[labels.point[labels.is_removed]] = False
    labelled[labels.point[labels.is_moved]] = True
    before = chosen_points(clean, kept & ~labelled)
    after = chosen_points(cloud[: int(kept.sum())], ~labelled[kept])
    return before.tobytes() != after.tobytes()


def _refuse_labels(attack: str, labels: Any, points: int) -> None:
    """Raises AdvpipeError for invalid labels of a clean cloud of so many points."""
    if not isinstance(labels, PointLabels):
        raise AdvpipeError(f"{attack} returned {_description(labels)} as its labels, not PointLabels")
    for name, kinds in _DTYPE_KINDS.items():
        array = getattr(labels, name)
        if not isinstance(array, np.ndarray) or array.ndim != 1 or array.dtype.kind not in kinds:
            raise AdvpipeError(f"{attack} returned {_description(array)} as labels.{name}; see PointLabels")
    lengths = {name: len(getattr(labels, name)) for name in _DTYPE_KINDS}
    if len(set(lengths.values())) > 1:
        raise AdvpipeError(f"{attack} returned labels of several lengths: {lengths}")
    is_known = labels.is_removed | labels.is_moved | labels.is_added
    if not is_known.all():
        strange = min(labels.action[~is_known].tolist())
        raise AdvpipeError(f"{attack} labels points as {strange!r}; known: {', '.join(ACTIONS)}")
    is_new = labels.is_added
    if ((labels.point[~is_new] < 0) | (labels.point[~is_new] >= points)).any() or (
        labels.point[is_new] != -1
    ).any():
        raise AdvpipeError(
            f"{attack} labels points that the cloud of {points} does not have; they are counted in the clean "
            "cloud from 0 up, and -1 for added ones"
        )


def _description(value: Any) -> str:
    """A value in short: its type, and of an array shape and dtype."""
    if isinstance(value, np.ndarray):
        return f"an array {value.shape} of {value.dtype}"
    return type(value).__name__
