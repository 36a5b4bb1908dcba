"""What rays of visible light meet in one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class PaneCrossings:
    """E passages of rays through panes. rays: (E,) int64. range_m, transmittance: (E,) float32, one-way.
    normals: (E, 3) float32, of either side."""

    rays: npt.NDArray[np.int64]
    range_m: Float32
    transmittance: Float32
    normals: Float32


@dataclass(frozen=True)
class VisibleHits:
    """The first opaque triangle that each of R rays meets, and the panes before it.

    range_m: (R,) float32, infinite for none. normals: (R, 3) float32, of either side. triangles:
    (R,) int32, -1 for none.
    """

    range_m: Float32
    normals: Float32
    triangles: npt.NDArray[np.int32]
    panes: PaneCrossings
