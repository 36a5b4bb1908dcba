"""Where rays enter boxes: CARLA tells what a ray hits first, not what it would hit without that."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, invert, se3_from_yaw


def entry_m(origin_m: Float64, directions: Float64, box: Float64) -> Float64:
    """Distance (...,) at which rays (..., 3) from an origin (3,) enter a box (7,) of the same frame; infinite
    if they miss it, 0 from within."""
    box_SE3_frame = invert(se3_from_yaw(box[:3], float(box[6])))
    local = directions @ box_SE3_frame[:3, :3].T
    start_m = box_SE3_frame[:3, :3] @ origin_m + box_SE3_frame[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = [(sign * box[3:6] / 2 - start_m) / local for sign in (-1, 1)]
    enter_m, leave_m = np.minimum(*ends).max(axis=-1), np.maximum(*ends).min(axis=-1)
    entered: Float64 = np.where((enter_m <= leave_m) & (leave_m > 0), np.maximum(enter_m, 0.0), np.inf)
    return entered
