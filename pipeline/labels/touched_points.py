"""The touched points of a cloud as its debug topic shows them, from the cloud's labels."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.points import ADDED, MOVED, REMOVED
from advpipe.pipeline.messages.cloud import chosen_points, xyz
from advpipe.pipeline.messages.debug import touched_points


def touched_by(change: CloudChange) -> npt.NDArray[np.void]:
    """Points (K,) of `TOUCHED_POINT_DTYPE`: first those removed, then those moved and those added."""
    clean, labels = change.clean, change.labels
    parts = (
        (chosen_points(clean, labels.point[labels.is_removed]), REMOVED, labels.is_removed),
        (change.moved[1], MOVED, labels.is_moved),
        (change.added, ADDED, labels.is_added),
    )
    return np.concatenate(
        [touched_points(xyz(part), action, labels.displacement_m[chosen]) for part, action, chosen in parts]
    )
