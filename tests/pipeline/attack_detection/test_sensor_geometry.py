"""The rays of a sensor, learnt from clouds of one whose rays are known."""

import numpy as np
import pytest
from rotating import COLUMNS, ELEVATIONS_DEG, cloud_of, ranges, rays, turn

from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.messages.cloud import xyz


@pytest.fixture(scope="module")
def sensor():
    return SensorGeometry.learnt([turn(seed) for seed in range(3)])


def test_elevations_and_columns_are_those_of_the_sensor(sensor):
    assert np.rad2deg(sensor.elevations_rad) == pytest.approx(ELEVATIONS_DEG, abs=1e-5)
    assert (sensor.columns, sensor.has_columns) == (COLUMNS, True)
    assert min(sensor.phase, 1 - sensor.phase) == pytest.approx(0, abs=1e-5)


def test_clean_points_are_on_their_rays_and_lifted_ones_are_not(sensor):
    cloud = turn(9)
    assert not sensor.off_ray(cloud).any()
    lifted = cloud.copy()
    lifted["z"][5] += np.float32(0.002)
    assert np.flatnonzero(sensor.off_ray(lifted)).tolist() == [5]
    swapped = cloud.copy()
    swapped["ring"][7] ^= 1
    assert np.flatnonzero(sensor.off_ray(swapped)).tolist() == [7]


def test_a_point_moved_along_its_ray_stays_on_it(sensor):
    cloud = turn(9)
    for axis in "xyz":
        cloud[axis] *= np.float32(1.01)
    assert not sensor.off_ray(cloud).any()


def test_a_point_beside_its_column_is_off_its_ray(sensor):
    cloud = turn(9)
    angle, points = 1e-3, xyz(cloud)[:1].astype(np.float64)
    cloud["x"][0] = points[0, 0] * np.cos(angle) - points[0, 1] * np.sin(angle)
    cloud["y"][0] = points[0, 0] * np.sin(angle) + points[0, 1] * np.cos(angle)
    assert np.flatnonzero(sensor.off_ray(cloud)).tolist() == [0]


def test_points_that_are_not_finite_are_on_no_ray(sensor):
    cloud = turn(9)
    cloud["x"][3] = np.nan
    assert not sensor.off_ray(cloud).any()
    assert sensor.cells(cloud)[0][3] == -1


def test_cells_are_the_rays_that_made_the_points(sensor):
    directions, rings = rays()
    ring, column = sensor.cells(cloud_of(ranges(directions), directions, np.zeros_like(rings)))
    assert ring.tolist() == rings.tolist()  # whatever ring the points state
    assert sensor.directions(ring, column) == pytest.approx(directions, abs=1e-6)


def test_clouds_without_rings_have_no_geometry():
    cloud = turn()
    cloud["ring"] = 0
    assert SensorGeometry.learnt([cloud]) is None
    shuffled = turn()
    shuffled["ring"] = np.random.default_rng(0).permutation(shuffled["ring"])
    assert SensorGeometry.learnt([shuffled]) is None
