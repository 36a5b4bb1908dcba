"""Points that are taken out of a simulated turn find their place, their ring and their time again."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.attack_detection.scan_order import (
    ScanOrder,
    as_measured,
    places_in_scan,
    scan_keys,
    scan_order_of,
)
from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.world import Hits

SENSORS = {
    "plain": {},
    "grid": {"coordinate_grid_m": 2.0**-9},
    "motion": {"motion_distortion": True},
    "motion, grid": {"motion_distortion": True, "coordinate_grid_m": 2.0**-9},
}


def turn(**keys):
    """A turn of 24 rings and 360 columns, of which a third returns nothing; a tenth is on a moving car."""
    sensor = LidarSensor(channels=24, points_per_second=24 * 360 * 10, noise_stddev=0.02, **keys)
    draw = np.random.default_rng(5)
    count = sensor.channels * sensor.columns
    range_m = draw.uniform(4, 60, count).astype(np.float32)
    range_m[draw.random(count) < 1 / 3] = np.inf
    ones = np.ones(count, np.float32)
    objects = np.where(np.arange(count) // 24 % 100 < 10, 0, -1).astype(np.int32)
    hits = Hits(range_m, ones, ones, np.zeros(count, bool), ones, objects, np.zeros(1, np.float32))
    return Lidar(sensor).measure(hits, draw, [[15.0, 3.0, 0.0]])


def learnt(cloud):
    return scan_order_of(cloud)


@pytest.mark.parametrize("keys", SENSORS.values(), ids=SENSORS)
def test_points_that_were_taken_out_come_back(keys) -> None:
    cloud = turn(**keys)
    still = np.flatnonzero((cloud["time"] == 0) | (np.arange(len(cloud)) % 2 == 0))
    taken = np.sort(np.random.default_rng(6).choice(still, 200, replace=False))
    if "motion" in str(keys):  # those on the car are not on their rays: nobody can tell where they belong
        flat = np.arctan2(cloud["y"], cloud["x"])[taken]
        column = np.rint((np.pi - flat) / (2 * np.pi) * 360)
        of_time = np.rint(359 + cloud["time"][taken] * 3600)
        taken = taken[column % 360 == of_time]
    rest, points = np.delete(cloud, taken), cloud[taken]
    order = learnt(rest)
    assert order is not None
    strange = points.copy()
    strange["ring"], strange["time"] = 3, 9.0
    stated = as_measured(rest, strange, order)
    assert (stated["ring"] == points["ring"]).all()
    assert np.abs(stated["time"] - points["time"]).max() < 1e-6
    places = places_in_scan(rest, stated, order)
    row = np.lexsort((scan_keys(stated, order), places))
    assert (np.insert(rest, places[row], points[row]) == cloud).all()


def test_rings_one_after_another() -> None:
    cloud = turn()
    cloud = cloud[np.argsort(cloud["ring"], kind="stable")]
    taken = np.arange(50, len(cloud) - 50, 41)
    order = learnt(np.delete(cloud, taken))
    assert order is not None
    assert not order.by_column
    places = places_in_scan(np.delete(cloud, taken), cloud[taken], order)
    assert (np.insert(np.delete(cloud, taken), places, cloud[taken]) == cloud).all()


def test_a_shuffled_turn_has_no_order_and_points_go_beside_their_neighbours() -> None:
    cloud = turn()
    cloud = cloud[np.random.default_rng(7).permutation(len(cloud))]
    assert learnt(cloud) is None
    points = cloud[:40].copy()
    for name in ("x", "y", "z"):
        points[name] *= 1.01  # on the same rays
    places = places_in_scan(cloud, points, None)
    assert (np.isin(places - np.arange(40), (0, 1))).all()
    assert (as_measured(cloud, points, None) == points).all()


def test_clouds_without_points() -> None:
    none = np.zeros(0, POINT_DTYPE)
    assert (places_in_scan(none, turn()[:3], None) == 0).all()
    cloud = turn()
    assert ScanOrder.learnt(none, SensorGeometry.learnt([cloud])) is None
    assert len(as_measured(cloud, none, learnt(cloud))) == 0
