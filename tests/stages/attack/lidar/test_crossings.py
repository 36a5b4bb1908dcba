from __future__ import annotations

import numpy as np
import pytest
import scipy.optimize

from advpipe.pipeline.baselines import move_within
from advpipe.pipeline.detector.protocol import VoxelGrid
from advpipe.stages.attack.lidar.crossings import find_crossings

GRID = VoxelGrid((0.0, 0.0, 0.0), (1.0, 1.0, 0.5), (10, 10, 10))


def test_hand_worked_faces_and_edges():
    # 4 cm from the face x = 2, 3 cm from y = 1, in the middle of a cell along z.
    start = np.array([[1.96, 1.03, 0.25]], np.float32)
    ways = find_crossings(start, GRID, 0.06, 0.01)
    found = {tuple(np.round(way, 6)) for way in ways.offset_m}
    assert found == {(0, 0, 0), (0.05, 0, 0), (0, -0.04, 0)}  # both together: 6.4 cm
    assert len(find_crossings(start, GRID, 0.07, 0.01).point) == 4
    assert not ways.offset_m[ways.home].any()


def test_nothing_leads_out_of_the_grid():
    start = np.array([[0.01, 0.01, 0.01], [9.99, 9.99, 4.99]], np.float32)
    ways = find_crossings(start, GRID, 0.3, 0.01)
    assert (ways.point == [0, 1]).all()
    assert not ways.offset_m.any()


@pytest.mark.parametrize("reach_m", [0.01, 0.3, 1.2])
def test_every_cell_in_reach_and_no_other_by_the_shortest_way(reach_m):
    draw = np.random.default_rng(0)
    start = draw.uniform(3, 4, (4, 3)).astype(np.float32) * np.float32([1, 1, 0.5])
    ways = find_crossings(start, GRID, reach_m, 0.002)
    arrived = move_within(start[ways.point], ways.offset_m)
    assert (GRID.keys(GRID.cells(arrived)) == ways.keys[ways.cell]).all()
    far_m = np.linalg.norm(arrived.astype(np.float64) - start[ways.point], axis=1)
    assert (far_m <= reach_m).all()
    away = np.array(np.meshgrid(*[range(-2, 3)] * 3)).reshape(3, -1).T
    for i, point in enumerate(start.astype(np.float64)):
        mine = {
            ways.keys[c]: far
            for c, far in zip(ways.cell[ways.point == i], far_m[ways.point == i], strict=True)
        }
        for cell in GRID.cells(start[i : i + 1]) + away:
            low = GRID.low_corners_m(cell[None])[0]
            bounds = (low + 0.002, low + GRID.size_m - 0.002)
            nearest_m = np.sqrt(2 * scipy.optimize.lsq_linear(np.eye(3), point, bounds, tol=1e-14).cost)
            key = GRID.keys(cell[None])[0]
            if (cell == GRID.cells(start[i : i + 1])[0]).all():
                assert mine[key] == 0
            elif abs(nearest_m - reach_m) > 1e-5:
                assert (key in mine) == (nearest_m < reach_m)
                assert mine.get(key, nearest_m) == pytest.approx(nearest_m, abs=1e-5)


def test_along_the_ray():
    draw = np.random.default_rng(1)
    start = draw.uniform(1, 4, (200, 3)).astype(np.float32)
    ways = find_crossings(start, GRID, 0.3, 0.002, along_ray=True)
    moved = ways.offset_m.any(axis=1)
    assert moved.sum() > 100
    away = np.cross(ways.offset_m, start[ways.point].astype(np.float64))
    assert np.abs(away[moved]).max() < 1e-9
    free = find_crossings(start, GRID, 0.3, 0.002)
    assert len(ways.point) < len(free.point)


def test_forbidden_places_are_no_options():
    draw = np.random.default_rng(2)
    start = draw.uniform(2, 4, (50, 3)).astype(np.float32)
    ways = find_crossings(start, GRID, 0.4, 0.01, forbidden=lambda places: places[:, 0] > 3)
    there = (start[ways.point] + ways.offset_m)[ways.offset_m.any(axis=1)]
    assert len(there) > 20
    assert (there[:, 0] <= 3).all()
    assert (np.bincount(ways.point, minlength=50) > 0).all()  # staying is always one
