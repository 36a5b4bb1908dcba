"""Roads on slopes and bridges: the surface lies where the traffic drives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from advpipe.stages.simulate.road_network.roads import KERB_M, resample
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID


def down(points_m: np.ndarray, from_m: float = 1.0) -> np.ndarray:
    """Rays straight down, starting above the points."""
    straight = np.tile([0.0, 0.0, -1.0], (len(points_m), 1))
    return np.concatenate([points_m + (0, 0, from_m), straight], axis=1).astype(np.float32)


def test_wheels_touch_the_surface_of_every_lane_within_3_cm(hill: Any) -> None:
    for edge in hill.network.drivable:
        for lane in edge.lanes:
            points = resample(lane.centre_m, 1.0)[1:-1]
            hits = hill.world._static.cast(down(points))
            assert np.abs(hits.range_m - 1.0).max() < 0.03, edge.id
            assert hill.world.roads.height_at(points[:, :2]).shape == (len(points),)


def test_the_bridge_spans_the_lower_road(hill: Any) -> None:
    """The bridge lies at 12 m, the road below at 3 m: 9 m of air, and both surfaces are asphalt."""
    edges = {edge.id: edge for edge in hill.network.drivable}
    x_m = edges["st"].lanes[0].centre_m[0, 0]
    y_m = edges["bc"].lanes[0].centre_m[0, 1]
    below = np.array([[x_m, y_m, 3.5, 0, 0, 1], [x_m, y_m, 3.5, 0, 0, -1]], np.float32)
    hits = hill.world._static.cast(below)
    assert hits.range_m == pytest.approx([8.5, 0.5], abs=0.01)
    assert set(hits.materials.tolist()) == {MATERIAL_ID["asphalt"]}
    assert len(hill.world.roads.levels) == 2
    assert hill.world.roads.height_at(np.array([[x_m, y_m]]))[0] == pytest.approx(3.0, abs=0.01)


def test_the_ground_covers_no_road_and_is_never_far_below(hill: Any) -> None:
    levels = hill.world.roads.levels
    for level in levels:
        xy = level.samples_m[:, :2] + (0, 12.0)
        hits = hill.world._static.cast(down(np.column_stack([xy, np.full(len(xy), 60.0)]), 0.0))
        assert np.isfinite(hits.range_m).all()


def test_fast_roads_have_rails_and_no_kerb(hill: Any, boulevard: Any) -> None:
    roads = hill.world.roads
    assert roads.verges_m
    assert not boulevard.world.roads.verges_m
    fast = np.concatenate(roads.verges_m)
    assert fast[:, 0].min() > 190.0  # b lies at 200 m
    materials = set(np.unique(hill.world._static._materials).tolist())
    assert MATERIAL_ID["rail"] in materials or MATERIAL_ID["barrier_concrete"] in materials
    for car in hill.world.parked:
        assert np.linalg.norm(fast[:, :2] - car.position_m[:2], axis=1).min() > 1.0


def test_kerbs_stand_above_flat_streets(boulevard: Any) -> None:
    """Beside every third kerb point: 1 m out there is a pavement, `KERB_M` above the road."""
    from advpipe.stages.simulate.road_network.roads import offset_right

    heights = []
    for kerb in boulevard.world.roads.kerbs_m:
        points = offset_right(kerb, 0.15)[2:-2:3]
        hits = boulevard.world._static.cast(down(points, 0.3))
        heights.append(0.3 - hits.range_m)
    assert np.median(np.concatenate(heights)) == pytest.approx(KERB_M, abs=1e-3)
    assert np.mean(np.abs(np.concatenate(heights) - KERB_M) < 2e-3) > 0.8


def test_parked_cars_follow_the_slope(hill: Any) -> None:
    for car in hill.world.parked:
        wheels = np.array([[car.variant.length_m * 0.3, 0, 0, 1], [-car.variant.length_m * 0.3, 0, 0, 1]])
        places = (wheels @ car.map_SE3_base.T)[:, :3]
        hits = hill.world._static.cast(down(places, 0.5))
        assert np.abs(hits.range_m - 0.5).max() < 0.08, car.id
