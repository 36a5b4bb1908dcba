"""Measures the Chamfer distance of two clouds relative to scipy's k-d tree.

    python benchmarks/chamfer.py [--points 100000] [--rounds 7] [--workers 2]

A cloud of a spinning LiDAR's density is compared with what each attack makes of it: few points removed, few
added, those near objects moved, and every point moved. The peer is Eq. 4 of the paper in the plainest form:
two `scipy.spatial.cKDTree`, one query of all points each way, on as many threads. Exit code 1 where our
median is above 0.2 s, unless there are fewer cores than threads, or where both do not agree to 1e-9.
"""

from __future__ import annotations

import argparse
import os
import statistics

import numpy as np
import numpy.typing as npt
from common import compare, finish, machine, steady_memory
from scipy.spatial import cKDTree

from advpipe.pipeline.metrics.chamfer import chamfer_distance

LIMIT_S = 0.2
Points = npt.NDArray[np.float32]


def turn(points: int, rng: np.random.Generator) -> Points:
    """The ground and walls at 8 to 60 m, as 64 channels see them 2 m above the ground."""
    azimuth = rng.uniform(-np.pi, np.pi, points)
    elevation = np.radians(rng.choice(np.linspace(-24, 4, 64), points))
    wall_m = 8 + 52 * np.abs(np.sin(3 * azimuth))
    ground_m = np.where(elevation < 0, 2 / np.maximum(np.sin(-elevation), 1e-3), np.inf)
    range_m = np.minimum(wall_m, ground_m) + rng.normal(0, 0.02, points)
    flat = np.cos(elevation)
    xyz = [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]
    return (range_m * np.stack(xyz)).T.astype(np.float32)


def attacked(cloud: Points, rng: np.random.Generator) -> dict[str, Points]:
    """What attacks make of a cloud (N, 3)."""
    count = len(cloud)
    few, tenth = rng.choice(count, count // 100), rng.choice(count, count // 10)
    near = cloud.copy()
    near[tenth] += rng.normal(0, 0.05, (len(tenth), 3)).astype(np.float32)
    return {
        "1 % removed": np.delete(cloud, few, axis=0),
        "300 added": np.concatenate([cloud, cloud[:300] + np.float32(0.3)]),
        "a tenth moved": near,
        "all moved": (cloud + rng.normal(0, 0.05, cloud.shape)).astype(np.float32),
    }


def plain(a: Points, b: Points, workers: int) -> float:
    """Eq. 4 as it stands."""
    a64, b64 = a.astype(np.float64), b.astype(np.float64)
    there, _ = cKDTree(b64).query(a64, workers=workers)
    back, _ = cKDTree(a64).query(b64, workers=workers)
    return float(np.square(there).mean() + np.square(back).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description="Chamfer distance beside scipy's k-d tree.")
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--workers", type=int, default=2, help="threads of both")
    options = parser.parse_args()
    print(machine())
    steady_memory()
    rng, passed = np.random.default_rng(0), True
    cloud = turn(options.points, rng)
    for name, other in attacked(cloud, rng).items():
        ours, peer = (f(cloud, other, options.workers) for f in (chamfer_distance, plain))
        agrees = abs(ours - peer) <= 1e-9 * peer
        timed = compare(
            name,
            lambda other=other: chamfer_distance(cloud, other, options.workers),  # type: ignore[misc]
            lambda other=other: plain(cloud, other, options.workers),  # type: ignore[misc]
            options.rounds,
        )
        median_s = statistics.median(timed.ours_s)
        in_time = median_s <= LIMIT_S or (os.cpu_count() or 1) < options.workers
        passed &= agrees and in_time
        print(timed.line(1, "clouds/s", 1.0))
        verdict = "ok" if in_time else "ABOVE"
        same = "equal" if agrees else "DIFFERENT"
        print(f"{'':<34} {median_s:.3f} s, mark {LIMIT_S} s {verdict}; {ours:.6f} m², {same}")
    finish(passed)


if __name__ == "__main__":
    main()
