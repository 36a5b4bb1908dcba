"""What a LiDAR sees of the vehicle that it sits on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.lidar.intensity import return_signal
from advpipe.pipeline.sensors.world import CarrierSurroundings, SurfaceDetail

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class OwnBody:
    """The returns of the own body along the R rays of a turn; it never changes.

    shaded: (R,) bool, whether the body is in the ray's way. range_m, signal: (R,) float32.
    """

    shaded: npt.NDArray[np.bool_]
    range_m: Float32
    signal: Float32


def look_at_own_body(world: CarrierSurroundings, rays: Float32, base_SE3_lidar: Float64) -> OwnBody | None:
    """The own body along rays (R, 6) in base_link; None if no ray hits it, or the sensor is inside it.

    A sensor with a part of the body above it is inside: such a mounting stands for a sensor built into the
    body, or for a body of another height, and looks through it.
    """
    above = np.array([[*base_SE3_lidar[:3, 3], 0.0, 0.0, 1.0]], np.float32)
    hits = world.cast_own_body(np.concatenate([rays, above]))
    shaded = np.isfinite(hits.range_m)
    if shaded[-1] or not shaded.any():
        return None
    seen = np.flatnonzero(shaded)
    signal = np.zeros(len(shaded), np.float32)
    detail = hits.detail()
    if detail is not None:  # clean and new
        detail = SurfaceDetail(np.ones_like(detail.texture), np.zeros_like(detail.texture), detail.gloss)
    signal[seen] = return_signal(hits, seen, 0.0, detail)
    return OwnBody(shaded[:-1], hits.range_m[:-1], signal[:-1])
