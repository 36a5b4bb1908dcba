"""The plane of the ground about a LiDAR, fitted to one cloud: robust to walls, objects and slopes ahead.

The ground is sampled in a polar grid, in which each cell has one vote, so that dense near rings do not decide
alone. The lowest points of the near cells give a first plane (RANSAC); then the plane grows outwards: points
that lie close to it, averaged by cell, refine it, ring by ring. A slope that begins farther away leaves the
plane before it can tilt it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64, se3

Int64 = npt.NDArray[np.int64]

NEAREST_M, FARTHEST_M = 2.5, 40.0
"""The ground is looked for between these ranges: nearer there is the vehicle itself."""

SEED_RANGES_M = (11.5, 16.0, 20.5)
"""The first plane comes from cells this near; where they are too few, from farther ones, too: a LiDAR that
looks down little meets the ground late."""

SECTORS, RING_M, RINGS_AT_ONCE = 36, 1.5, 3

MAX_TILT_DEG = 15.0
HEIGHTS_M = (0.3, 8.0)
"""The plane may be tilted this much, and lie this far below the LiDAR."""

CLOSE_M = 0.04
"""A point belongs to the plane within this distance, which is less than half of a kerb's height."""

LAYER_M = 0.02
"""The lowest points of a cell within this height are one layer: road, pavement and verge are apart."""

LANE_HALF_WIDTH_M, LANE_WEIGHT = 2.0, 6.0
"""The vehicle stands on the road, not on the pavement or the verge beside it: the cells ahead and behind have
this weight in the first plane."""

MIN_CELLS = 15
MIN_SHARE = 0.35
"""The fit needs this many cells, and its first plane that share of the near ones by weight."""

MIN_SPREAD_M = 1.5
"""The standard deviation of the cells' positions along their narrowest direction."""

LEAST_SCALE_M = 0.003
"""Road and range noise: cells nearer to the plane than this are equally good."""

_DRAWS, _ROBUST_STEPS = 400, 6
_TUKEY, _NORMAL = 4.685, 1.4826
"""The biweight's constant, and the standard deviation of a normal variable over its median absolute value."""


@dataclass(frozen=True)
class GroundPlane:
    """The ground z = slope_x * x + slope_y * y - offset_m in the LiDAR's frame."""

    slope_x: float
    slope_y: float
    offset_m: float

    @property
    def normal(self) -> Float64:
        """The unit normal (3,), upwards."""
        up = np.array([-self.slope_x, -self.slope_y, 1.0])
        return np.asarray(up / np.linalg.norm(up))

    @property
    def height_m(self) -> float:
        """The distance of the LiDAR from the ground."""
        return float(self.offset_m * self.normal[2])

    @property
    def tilt_rad(self) -> float:
        """The angle between the LiDAR's vertical axis and the normal."""
        return float(np.arctan(np.hypot(self.slope_x, self.slope_y)))

    def level_SE3_lidar(self) -> Float64:
        """The smallest rotation (4, 4) about the LiDAR that turns the normal to z."""
        x, y, z = self.normal
        # Rodrigues' formula for the axis normal x z and the cosine z.
        rotation = np.array(
            [
                [1 - x * x / (1 + z), -x * y / (1 + z), -x],
                [-x * y / (1 + z), 1 - y * y / (1 + z), -y],
                [x, y, z],
            ]
        )
        return se3(rotation, np.zeros(3))


@dataclass(frozen=True)
class _Cells:
    """The finite points (N, 3) between the ranges, sorted into C cells of the polar grid.

    cell: (N,) of each point. lowest: (C,) the lowest point, N for none.
    """

    points: Float64
    cell: Int64
    lowest: Int64

    @classmethod
    def of(cls, xyz: npt.ArrayLike) -> _Cells:
        points = np.asarray(xyz, dtype=np.float64).reshape(-1, 3)
        range_m = np.hypot(points[:, 0], points[:, 1])
        with np.errstate(invalid="ignore"):
            near = (range_m >= NEAREST_M) & (range_m < FARTHEST_M)
            near &= (points[:, 2] < 1.0) & (points[:, 2] > -2 * HEIGHTS_M[1])  # also drops NaN
        points, range_m = points[near], range_m[near]
        ring = ((range_m - NEAREST_M) / RING_M).astype(np.int64)
        turn = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) + 0.5
        cell = ring * SECTORS + np.minimum((turn * SECTORS).astype(np.int64), SECTORS - 1)
        count = _rings_to(FARTHEST_M) * SECTORS
        lowest_m = np.full(count, np.inf)
        np.minimum.at(lowest_m, cell, points[:, 2])
        lowest = np.full(count, len(points))
        at = np.flatnonzero(points[:, 2] == lowest_m[cell])
        lowest[cell[at[::-1]]] = at[::-1]  # of equally low ones, the first
        return cls(points, cell, lowest)

    def seeds(self, range_m: float) -> Float64:
        """The means (K, 3) of the lowest layer of the cells up to a range."""
        lowest_m = np.append(self.points[:, 2], np.inf)[self.lowest]
        return self._means(self.points[:, 2] < lowest_m[self.cell] + LAYER_M, _rings_to(range_m), 1)

    def means(self, plane: Float64, rings: int) -> Float64:
        """The means (K, 3) of the points close to a plane (3,), of each cell of the first rings."""
        above_m = self.points[:, 2] - (self.points[:, :2] @ plane[:2] + plane[2])
        return self._means(np.abs(above_m) < CLOSE_M, rings, 3)

    def _means(self, chosen: npt.NDArray[np.bool_], rings: int, least: int) -> Float64:
        last = rings * SECTORS
        points = np.flatnonzero(chosen & (self.cell < last))
        cell = self.cell[points]
        count = np.bincount(cell, minlength=last)
        kept = count >= least
        sums = [np.bincount(cell, self.points[points, axis], minlength=last)[kept] for axis in range(3)]
        return np.stack(sums, axis=1) / count[kept, None]


def _rings_to(range_m: float) -> int:
    return round((range_m - NEAREST_M) / RING_M)


def fit_ground(xyz: npt.ArrayLike) -> GroundPlane | str:
    """The plane of the ground in a cloud (N, 3 or more), or why there is none, as a clause.

    It takes a few milliseconds and draws nothing at random from outside: the same cloud has the same plane.
    """
    cells = _Cells.of(np.asarray(xyz)[:, :3])
    for range_m in SEED_RANGES_M:
        seeds = cells.seeds(range_m)
        if len(seeds) >= MIN_CELLS:
            break
    else:
        return f"only {len(seeds)} of {SECTORS} x {RING_M:g} m cells within {range_m:g} m hold points"
    plane = _ransac(seeds)
    if plane is None:
        return "no plane of the ground among the lowest points"
    for rings in range(_rings_to(range_m), _rings_to(FARTHEST_M) + 1, RINGS_AT_ONCE):
        means = cells.means(plane, rings)
        if len(means) < MIN_CELLS:
            return f"only {len(means)} cells of the ground agree on a plane"
        plane = _robust(means)
    return _checked(plane, means)


def _ransac(seeds: Float64) -> Float64 | None:
    """The plane (3,), slopes and height, with the most of the seeds (K, 3) close to it."""
    weight = np.where(np.abs(seeds[:, 1]) < LANE_HALF_WIDTH_M, LANE_WEIGHT, 1.0)
    draw = np.random.default_rng(0)
    chances = np.cumsum(weight) / weight.sum()
    triples = seeds[np.searchsorted(chances, draw.random((_DRAWS, 3)))]
    planes = _through(triples)
    tilt = np.hypot(planes[:, 0], planes[:, 1])
    valid = (tilt < np.tan(np.radians(MAX_TILT_DEG))) & (planes[:, 2] < -HEIGHTS_M[0])
    planes = planes[valid & (planes[:, 2] > -HEIGHTS_M[1])]
    if not len(planes):
        return None
    off_m = np.abs(seeds[None, :, 2] - (planes[:, :2] @ seeds[:, :2].T + planes[:, 2, None]))
    best = int(np.argmax(np.clip(1 - off_m / LAYER_M, 0, None) @ weight))
    if weight[off_m[best] < 2 * LAYER_M].sum() < MIN_SHARE * weight.sum():
        return None
    return np.asarray(planes[best])


def _through(triples: Float64) -> Float64:
    """The planes (T, 3) through three points each (T, 3, 3); NaN where those lie on a vertical plane."""
    a, b = triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0]
    normal = np.cross(a, b)
    up = np.where(np.abs(normal[:, 2]) > 1e-6, normal[:, 2], np.nan)
    slopes = -normal[:, :2] / up[:, None]
    offset = triples[:, 0, 2] - (slopes * triples[:, 0, :2]).sum(axis=1)
    return np.column_stack([slopes, offset])


def _robust(points: Float64) -> Float64:
    """The plane (3,) of most of the points (K, 3), by iteratively reweighted least squares.

    Two steps towards the least absolute distances, then Tukey's biweight, whose scale is the median distance:
    a verge or a slope that lies a little off has no weight in the end.
    """
    weight = np.ones(len(points))
    for step in range(_ROBUST_STEPS):
        plane = _least_squares(points, weight)
        off_m = np.abs(points[:, 2] - (points[:, :2] @ plane[:2] + plane[2]))
        if step < 2:
            weight = 1 / np.maximum(off_m, LEAST_SCALE_M)
        else:
            scale_m = _TUKEY * max(float(np.median(off_m)) * _NORMAL, LEAST_SCALE_M)
            weight = np.clip(1 - (off_m / scale_m) ** 2, 0, None) ** 2
    return _least_squares(points, weight)


def _least_squares(points: Float64, weight: Float64) -> Float64:
    """The plane (3,) nearest to points (K, 3) with these weights (K,)."""
    columns = np.column_stack([points[:, :2], np.ones(len(points))])
    weighted = columns.T * weight
    plane, *_ = np.linalg.lstsq(weighted @ columns, weighted @ points[:, 2], rcond=None)
    return np.asarray(plane)


def _checked(plane: Float64, means: Float64) -> GroundPlane | str:
    """The plane, or why it is not to be trusted."""
    spread_m = np.linalg.svd(means[:, :2] - means[:, :2].mean(axis=0), compute_uv=False)[-1]
    spread_m /= np.sqrt(len(means))
    if spread_m < MIN_SPREAD_M:
        return f"the ground is seen in a strip of {2 * spread_m:.1f} m only"
    found = GroundPlane(float(plane[0]), float(plane[1]), -float(plane[2]))
    tilt_deg = np.degrees(found.tilt_rad)
    if tilt_deg > MAX_TILT_DEG or not HEIGHTS_M[0] < found.height_m < HEIGHTS_M[1]:
        return f"the lowest plane is {found.height_m:.1f} m below, tilted by {tilt_deg:.0f}°"
    return found
