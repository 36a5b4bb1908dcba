"""Heights above the ground at which a LiDAR can be mounted."""

from __future__ import annotations

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import option_name

LOWEST_M, HIGHEST_M = 0.3, 10.0
"""From the bumper of a car or a delivery robot to a mast beside the road: what lies outside has another unit,
or is the height of something else."""


def check_lidar_height(height_m: float | None) -> None:
    """Raises UsageError for a height in metres that no LiDAR has; None stands for an unknown one."""
    if height_m is not None and not LOWEST_M <= height_m <= HIGHEST_M:
        raise UsageError(
            f"{option_name('lidar_height_m')} is {height_m:g}, but must be {LOWEST_M:g} to {HIGHEST_M:g}, "
            "the height of the LiDAR above the ground in metres"
        )
