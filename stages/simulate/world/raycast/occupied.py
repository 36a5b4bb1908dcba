"""Occupied ground: no object may stand on a road or overlap another."""

from __future__ import annotations

import numpy as np
import shapely

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.roads import Roads

CELL_M = 30.0

WALKWAY_M = (3.05, 5.0)
"""The strip along a kerb, by its distance from it, that belongs to pedestrians."""


def footprint(map_SE3_base: Float64, length_m: float, width_m: float) -> shapely.Polygon:
    """A rectangle as seen from above, its length along the pose's x axis."""
    along, across = map_SE3_base[:2, 0] * (length_m / 2), map_SE3_base[:2, 1] * (width_m / 2)
    middle = map_SE3_base[:2, 3]
    corners = [middle + a * along + b * across for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    return shapely.Polygon(corners)


def walkways(roads: Roads) -> shapely.Geometry:
    """The ground on which pedestrians walk beside streets."""
    kerbs = shapely.MultiLineString([line[:, :2] for line in roads.kerbs_m if len(line) > 1])
    return kerbs.buffer(WALKWAY_M[1]).difference(kerbs.buffer(WALKWAY_M[0]))


def pavements(roads: Roads) -> shapely.Geometry:
    """All ground from the kerbs of streets to the far side of the walkways."""
    kerbs = shapely.MultiLineString([line[:, :2] for line in roads.kerbs_m if len(line) > 1])
    return kerbs.buffer(WALKWAY_M[1])


class Occupied:
    """Footprints of the roads, of more ground to be left free, and of the objects placed so far, in the
    map's x-y plane."""

    def __init__(self, roads: Roads, clearance_m: float = 0.2, free: shapely.Geometry | None = None) -> None:
        self._barred = roads.area.buffer(clearance_m)
        if free is not None:
            self._barred = self._barred.union(free)
        shapely.prepare(self._barred)
        self._cells: dict[tuple[int, int], list[shapely.Polygon]] = {}

    def take(self, map_SE3_base: Float64, length_m: float, width_m: float) -> bool:
        """Occupy a rectangle if it is free; return whether it was."""
        return self._take(footprint(map_SE3_base, length_m, width_m))

    def take_line(self, path_m: Float64, width_m: float) -> bool:
        """Occupy the strip along a path (K, 3) if it is free; return whether it was."""
        return self._take(shapely.LineString(path_m[:, :2]).buffer(width_m / 2, cap_style="flat"))

    def _take(self, footprint: shapely.Polygon) -> bool:
        if footprint.is_empty or self._barred.intersects(footprint):
            return False
        x_min, y_min, x_max, y_max = (int(np.floor(v / CELL_M)) for v in footprint.bounds)
        cells = [(i, j) for i in range(x_min, x_max + 1) for j in range(y_min, y_max + 1)]
        if any(footprint.intersects(other) for cell in cells for other in self._cells.get(cell, ())):
            return False
        for cell in cells:
            self._cells.setdefault(cell, []).append(footprint)
        return True
