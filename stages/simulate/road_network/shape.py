"""The `shape` attribute of a SUMO network: points in plane or in space, as text."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64


def parse_shape(text: str) -> Float64:
    """The points (N, 3) of "x,y x,y,z ...", in metres.

    SUMO omits a z of 0, so one shape may have points with and without z. Raises ValueError for any other
    text.
    """
    points = []
    for point in text.split():
        x_m, y_m, *z_m = map(float, point.split(","))
        if len(z_m) > 1:
            raise ValueError(f"the point {point!r} has {2 + len(z_m)} coordinates")
        points.append((x_m, y_m, *(z_m or [0.0])))
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def shape_text(shape_m: Float64) -> str:
    """Points (N, 3) as SUMO writes them: to the centimetre, without a z that is 0."""
    return " ".join(
        f"{x:.2f},{y:.2f},{z:.2f}" if round(z, 2) else f"{x:.2f},{y:.2f}" for x, y, z in shape_m.tolist()
    )


def length_m(shape_m: Float64) -> float:
    """The length in metres of the polyline through the points (N, 3)."""
    return float(np.linalg.norm(np.diff(shape_m, axis=0), axis=1).sum())
