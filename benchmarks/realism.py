"""One table of what LiDAR clouds measure, for any bags: a real sensor's beside simulated ones.

    python benchmarks/realism.py BAG [BAG ...] [--frames ::5] [--lidar /topic]

Real sensors' columns that others measured are comparable where the definitions are the same. They are, within
3 %, for points, angles, the share of ground and the intensities of all points and of the ground, and within
10 % for the 5 % quantile of intensities. What depends on which few walls and cars a drive passes differs by
more from one half of a drive to the other: plane residuals by 12 %, intensities of cars by 8 to 20 %, points
on cars by 10 to 30 %.

A bag may be any that advpipe reads, such as one that another tool recorded or `advpipe import` made. A row
that a bag has no data for (boxes of cars, rings) shows a dash.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frames import find_lidar_topic, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.geometry.boxes import CLASSES, MIN_POINTS, Boxes, points_in_boxes
from advpipe.pipeline.geometry.ground_plane import fit_ground
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.stages.evaluate.detection.occlusion import Occlusion

GROUND_M = 0.12
"""Ground points lie this close to the plane of the ground about the LiDAR: a road without its pavements."""

HIGH_DEG = -8.6
"""The border of the two blocks of lasers of a Velodyne HDL-64E."""

CELL_M, CELL_POINTS, CELL_RANGE_M = 1.0, 15, 25.0
"""Residuals are of planes through points of cubes of this side with at least so many points, so near."""

FLATNESS = 0.01
"""A cell is a piece of a plane if its smallest variance is less than this share of its second."""

UPRIGHT, LEVEL = 0.2, 0.95
"""Walls have a normal with |z| below the first value, the ground one above the second."""

CAR_RANGES_M, CAR_BAND_M = (10, 20, 30, 40), 4.0

MOST_HIDDEN = 0.1
"""A visible car is hidden by less than this share, as KITTI's occlusion 0, "fully visible"."""


class CloudStatistics:
    """Sums over the frames of one bag; `rows` has the results by name, NaN where there is no data."""

    def __init__(self) -> None:
        self._clouds: list[dict[str, float]] = []
        self._intensity: list[npt.NDArray[np.float32]] = []
        self._of_cars: list[npt.NDArray[np.float32]] = []
        self._of_ground: list[npt.NDArray[np.float32]] = []
        self._cars: list[tuple[float, float, int]] = []
        self._sizes: list[Float64] = []
        self._residuals: dict[str, list[Float64]] = {"walls": [], "ground": []}
        self._rings: list[npt.NDArray[np.int64]] = []

    def add(self, cloud: Cloud, boxes: Boxes, hidden: Mapping[str, float]) -> None:
        """One frame: boxes in the LiDAR's frame; hidden: the occluded share of its road users, by id."""
        cloud = cloud[np.isfinite(xyz(cloud)).all(axis=1)]
        points = xyz(cloud).astype(np.float64)
        if not len(points):
            return
        level_m = np.hypot(points[:, 0], points[:, 1])
        self._clouds.append(
            {
                "points a cloud": len(points),
                f"share above {HIGH_DEG:g} degrees": np.mean(
                    np.degrees(np.arctan2(points[:, 2], level_m)) > HIGH_DEG
                ),
            }
        )
        self._intensity.append(cloud["intensity"])
        self._rings.append(np.bincount(cloud["ring"]))
        is_ground = self._ground(points, cloud["intensity"])
        near = level_m < CELL_RANGE_M
        self._residuals["walls"].append(plane_residuals(points[near & ~is_ground], 0, UPRIGHT))
        self._residuals["ground"].append(plane_residuals(points[near & is_ground], LEVEL, 1))
        cars = boxes[boxes.labels == CLASSES.index("car")]
        for index, inside in enumerate(points_in_boxes(points, cars.geometry)):
            if len(inside) < MIN_POINTS:
                continue
            away_m = float(np.hypot(*cars.geometry[index, :2]))
            self._cars.append((away_m, hidden.get(cars.ids[index], np.nan), len(inside)))
            self._sizes.append(cars.geometry[index, 3:6])
            self._of_cars.append(cloud["intensity"][inside])

    def _ground(self, points: Float64, intensity: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        """Which points (N, 3) are of the ground; none without a plane."""
        plane = fit_ground(points)
        if isinstance(plane, str):
            return np.zeros(len(points), bool)
        above_m = points[:, 2] - points[:, :2] @ (plane.slope_x, plane.slope_y) + plane.offset_m
        ground: npt.NDArray[np.bool_] = np.abs(above_m) < GROUND_M
        self._clouds[-1]["ground share"] = ground.mean()
        self._of_ground.append(intensity[ground])
        return ground

    def rows(self) -> dict[str, float]:
        """The table's column."""
        found = {
            name: _mean(cloud[name] for cloud in self._clouds if name in cloud)
            for name in ("points a cloud", f"share above {HIGH_DEG:g} degrees", "ground share")
        }
        for away_m in CAR_RANGES_M:
            seen = [
                points
                for range_m, occluded, points in self._cars
                if abs(range_m - away_m) < CAR_BAND_M and not occluded >= MOST_HIDDEN
            ]
            found[f"points on a visible car at {away_m} m"] = _median(seen)
        everything, cars, ground = map(_joined, (self._intensity, self._of_cars, self._of_ground))
        found["intensity, mean"] = _mean(everything)
        for percent in (5, 50, 95):
            found[f"intensity, {percent} %"] = _percentile(everything, percent)
        found["intensity exactly 0, share"] = _mean(everything == 0)
        found["intensity on ground, mean"] = _mean(ground)
        found["intensity on cars, mean"], found["intensity on cars, median"] = _mean(cars), _median(cars)
        for kind, residuals in self._residuals.items():
            found[f"plane residual, {kind} [cm]"] = 100 * float(np.sqrt(_mean(_joined(residuals) ** 2)))
        for side, name in enumerate(("length", "width", "height")):
            found[f"cars' {name}, mean [m]"] = _mean(size[side] for size in self._sizes)
        found |= self._returns_per_ring()
        return found

    def _returns_per_ring(self) -> dict[str, float]:
        count = max((len(rings) for rings in self._rings), default=0)
        names = [f"returns per ring, {name}" for name in ("lowest", "median", "highest")]
        if count < 2:  # a bag without rings
            return dict.fromkeys(names, np.nan)
        mean = np.mean([np.pad(rings, (0, count - len(rings))) for rings in self._rings], axis=0)
        return dict(zip(names, (float(mean[0]), float(np.median(mean)), float(mean[-1])), strict=True))


def plane_residuals(points: Float64, least_up: float, most_up: float) -> Float64:
    """The RMS distances (K,) in metres of the points (N, 3) of each flat cell from its plane.

    Only planes whose normals have a |z| between these values count.
    """
    _, cell, count = np.unique(
        np.floor(points / CELL_M).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    cell = cell.ravel()
    middle = np.stack([np.bincount(cell, points[:, axis]) for axis in range(3)], axis=1) / count[:, None]
    away = points - middle[cell]
    spread = np.empty((len(count), 3, 3))
    for a in range(3):
        for b in range(a, 3):
            spread[:, a, b] = spread[:, b, a] = np.bincount(cell, away[:, a] * away[:, b]) / count
    variance, axes = np.linalg.eigh(spread[count >= CELL_POINTS])
    up = np.abs(axes[:, 2, 0])
    kept = (variance[:, 0] < FLATNESS * variance[:, 1]) & (up >= least_up) & (up <= most_up)
    return np.sqrt(np.maximum(variance[kept, 0], 0))


def measure(bag: Path, frames: FrameSlice, lidar_topic: str | None = None) -> dict[str, float]:
    """The statistics of one bag, by name."""
    reader = BagReader(resolve_bag(bag))
    occlusion = Occlusion(reader, find_lidar_topic(reader, lidar_topic))
    statistics = CloudStatistics()
    for frame in read_frames(reader, frames, lidar_topic=lidar_topic):
        statistics.add(frame.cloud, frame.boxes, occlusion.at(frame.stamp_ns))
    return statistics.rows()


def table(heads: Sequence[str], columns: Sequence[Mapping[str, float]]) -> str:
    """The columns under their heads, as a Markdown table."""
    lines = ["| |" + "".join(f" {head} |" for head in heads), "|---|" + "---|" * len(columns)]
    for name in columns[0]:
        lines.append(f"| {name} |" + "".join(f" {_shown(column[name])} |" for column in columns))
    return "\n".join(lines)


def _shown(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{value:,.0f}" if abs(value) >= 20 else f"{value:.3f}"


def _joined(parts: list[npt.NDArray[np.floating]]) -> npt.NDArray[np.floating]:
    return np.concatenate(parts) if parts else np.zeros(0)


def _mean(values: Iterable[float] | npt.NDArray[np.generic]) -> float:
    given = np.asarray(values if isinstance(values, np.ndarray) else list(values), dtype=np.float64)
    return float(given.mean()) if given.size else np.nan


def _median(values: Iterable[float] | npt.NDArray[np.generic]) -> float:
    return _percentile(np.asarray(values), 50)


def _percentile(values: npt.NDArray[np.generic], percent: float) -> float:
    return float(np.percentile(values, percent)) if values.size else np.nan


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("bags", type=Path, nargs="+")
    parser.add_argument("--frames", default="::5", help="which clouds, as START:STOP:STEP")
    parser.add_argument("--lidar", default=None, help="topic of the LiDAR, where a bag has several")
    given = parser.parse_args()
    try:
        frames = FrameSlice.parse(given.frames)
        columns = [measure(bag, frames, given.lidar) for bag in given.bags]
    except AdvpipeError as error:
        print(error, file=sys.stderr)
        return 1
    print(table([str(bag) for bag in given.bags], columns))
    return 0


if __name__ == "__main__":
    sys.exit(main())
