"""Places beside kerbs, and the poses of what stands there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw


@dataclass(frozen=True)
class Plot:
    """A place beside a kerb: the kerb's point, its direction, and the side away from the road."""

    kerb_m: Float64
    yaw_rad: float

    def at(self, offset_m: float, z_m: float = 0.0, turn_rad: float = 0.0, pitch_rad: float = 0.0) -> Float64:
        """The pose (4, 4), heading along the road, `offset_m` outward from the kerb."""
        outward = np.array([np.sin(self.yaw_rad), -np.cos(self.yaw_rad), 0.0])
        return se3_from_yaw(
            self.kerb_m + offset_m * outward + (0, 0, z_m), self.yaw_rad + turn_rad, pitch_rad
        )


def plots_along(
    lines: tuple[Float64, ...], per_km: float, rng: np.random.Generator
) -> Iterator[tuple[Plot, float]]:
    """Places drawn evenly along kerbs, `per_km` of them for each kilometre, and the slope there."""
    for kerb in lines:
        pieces = np.diff(kerb, axis=0)
        lengths = np.linalg.norm(pieces[:, :2], axis=1)
        total_m = float(lengths.sum())
        ends = np.cumsum(lengths)
        for place_m in np.sort(rng.random(rng.poisson(total_m * per_km / 1000)) * total_m):
            index = min(int(np.searchsorted(ends, place_m, side="right")), len(pieces) - 1)
            long_m = max(float(lengths[index]), 1e-9)
            part = 1 - (ends[index] - place_m) / long_m
            yaw_rad = float(np.arctan2(pieces[index, 1], pieces[index, 0]))
            yield Plot(kerb[index] + part * pieces[index], yaw_rad), float(pieces[index, 2] / long_m)
