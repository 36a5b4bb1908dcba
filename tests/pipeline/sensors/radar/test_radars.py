"""Radars in a world of boxes: what they see of cars, of a guard rail, of wheels and of turning cars."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from box_world import BoxWorld, cars, instant

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import cloud_from_cdr
from advpipe.pipeline.messages.radar import RadarReturns, scan_from_cdr, xyz_of_returns
from advpipe.pipeline.sensors.radar.association import in_view, over_ground_mps, returns_of_boxes
from advpipe.pipeline.sensors.radar.cross_section import PATTERNS, road_user_rcs_m2
from advpipe.pipeline.sensors.radar.radars import Radars
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.pipeline.sensors.sensor import DriveSettings
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import SURFACES
from advpipe.stages.simulate.world.raycast.materials import SEMANTIC_CLASSES

DRIVE = DriveSettings(7, 0.1, Weather(), False)
QUIET = {"false_alarm_probability": 1e-12, "detection_range_m": 300.0, "swerling": 0, "x_m": 0.0}


def radars(**keys: Any) -> Radars:
    return Radars("ego", {"front": RadarSensor(**{**QUIET, **keys})}, DRIVE)


def scan(one: Radars, world: BoxWorld, **motion: float) -> RadarReturns:
    return scan_from_cdr(one.sense(instant(world, **motion)).messages[0][1]).returns


def in_radar(boxes: Boxes, height_m: float = 0.5) -> Boxes:
    return boxes.transformed(np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -height_m], [0, 0, 0, 1.0]]))


def test_a_car_ahead_is_measured_at_its_rear() -> None:
    world = BoxWorld(cars([(40, 0)], speed_mps=15.0))
    found = scan(radars(), world, velocity_mps=20.0)
    strongest = found[np.argmax(found["amplitude"])]
    assert strongest["range"] == pytest.approx(40 - 2.25, abs=0.3)
    assert strongest["velocity"] == pytest.approx(-5.0, abs=0.1)


def test_scan_and_points_say_the_same() -> None:
    one = radars(**{"preset": "imaging-4d", "z_m": 0.6})
    reading = one.sense(instant(BoxWorld(cars([(30, 4), (50, -6)]))))
    (topic, scan_cdr, _), (points_topic, points_cdr, _) = reading.messages
    assert (topic.name, topic.type) == ("/ego/front/scan", "radar_msgs/msg/RadarScan")
    assert (points_topic.name, points_topic.type) == ("/ego/front/points", "sensor_msgs/msg/PointCloud2")
    returns, cloud = scan_from_cdr(scan_cdr).returns, cloud_from_cdr(points_cdr).cloud
    assert len(returns) > 10
    stacked = np.stack([cloud[axis] for axis in "xyz"], axis=1)
    assert np.abs(stacked - xyz_of_returns(returns)).max() < 1e-4
    assert {"car0", "car1"} == set(reading.road_users)


@pytest.mark.parametrize(("share", "is_seen"), [(0.0, False), (0.03, True)])
def test_a_hidden_car_is_seen_beneath_the_one_before_it(share: float, is_seen: bool) -> None:
    boxes = cars([(20, 0), (30, 0), (30, 6)], speed_mps=10.0)
    found = scan(radars(underbody_share=share), BoxWorld(boxes))
    near = returns_of_boxes(RadarSensor(**QUIET), found, in_radar(boxes), 0.3)
    assert [len(one) > 0 for one in near] == [True, is_seen, True]
    if is_seen:
        assert found["range"][near[1]].min() == pytest.approx(30 - 2.25, abs=0.5)
        assert found["velocity"][near[1]] == pytest.approx(10.0, abs=0.2)
        alone = scan(radars(), BoxWorld(cars([(30, 0)], speed_mps=10.0)))
        weaker_db = alone["amplitude"].max() - found["amplitude"][near[1]].max()
        assert weaker_db == pytest.approx(-10 * np.log10(0.03), abs=2.5)


def test_a_wall_hides_what_is_behind_it() -> None:
    boxes = cars([(40, 12)])
    keys = {"horizontal_fov": 90.0, "guard_rail_reflection": 0.0, "z_m": 0.3}
    flat = Boxes(boxes.geometry * [1, 1, 0.3, 1, 1, 0.3, 1], boxes.labels, boxes.ids, boxes.velocity_mps)
    section = RadarSensor(**QUIET)
    for rail_y_m, is_seen in ((None, True), (5.0, False)):
        found = scan(radars(**keys), BoxWorld(flat, rail_y_m=rail_y_m))
        near = returns_of_boxes(section, found, in_radar(flat, 0.3), 0.1)
        assert (len(near[0]) > 0) is is_seen


def test_the_radars_place_on_a_turning_vehicle_counts() -> None:
    """At 3 m ahead of the centre, 0.5 rad/s move it by 1.5 m/s to the left, at a car on the left by 60
    degrees: it comes nearer by 1.5 sin(60)."""
    world = BoxWorld(cars([(3 + 15, 26)]))
    found = scan(radars(x_m=3.0, horizontal_fov=140.0), world, turn_rate_radps=0.5)
    near = returns_of_boxes(RadarSensor(**QUIET), found, in_radar(cars([(15, 26)])), 0.3)[0]
    assert len(near)
    expected = -1.5 * np.sin(found["azimuth"][near])
    assert found["velocity"][near] == pytest.approx(expected, abs=0.15)
    assert over_ground_mps(RadarSensor(**QUIET), found, np.array([0, 1.5, 0]))[near] == pytest.approx(
        0, abs=0.15
    )


def test_a_turning_car_spreads_in_velocity() -> None:
    """A car across, 4.5 m long, that turns by 1 rad/s: its ends go 2 m/s to and from the radar."""
    one = radars(range_resolution_m=0.2, azimuth_resolution_deg=0.5, scatterers=200)
    scan(one, BoxWorld(cars([(20, 0)], yaws_rad=[np.pi / 2 - 0.1])))
    found = scan(one, BoxWorld(cars([(20, 0)], yaws_rad=[np.pi / 2])), frame=1)
    car = found[found["amplitude"] > found["amplitude"].max() - 25]
    assert car["velocity"].max() > 1.5
    assert car["velocity"].min() < -1.5
    assert np.corrcoef(car["azimuth"], car["velocity"])[0, 1] < -0.9  # the left end, its front, comes nearer


def test_wheels_spread_velocities_only_for_those_who_want_them() -> None:
    world = BoxWorld(cars([(30, 6)], speed_mps=15.0))
    spreads = {}
    for wheels in (False, True):
        one = radars(wheels=wheels, velocity_resolution_mps=0.2, detection_range_m=1000.0)
        found = np.concatenate([scan(one, world, frame=frame) for frame in range(8)])
        moving = found[found["velocity"] > 1]
        spreads[wheels] = float(np.ptp(moving["velocity"]))
    assert spreads[False] < 1.0
    assert 5 < spreads[True] <= 30.5  # from 0 to twice the speed of the car


def test_a_guard_rail_shows_the_mirror_image_of_a_car() -> None:
    """A rail at y = 5: the car at (40, 0) appears at (40, 10), with the same Doppler along x."""
    world = BoxWorld(cars([(40, 0)], speed_mps=20.0), rail_y_m=5.0)
    keys = {"horizontal_fov": 100.0, "points_per_second": 40_000, "detection_range_m": 600.0}
    found = scan(radars(**keys, guard_rail_reflection=0.5), world)
    moving = found["velocity"] > 5
    place_m = xyz_of_returns(found)
    ghosts = moving & (place_m[:, 1] > 5)
    assert ghosts.any()
    assert place_m[ghosts][:, :2].mean(axis=0) == pytest.approx([38, 10], abs=2.0)
    assert found["velocity"][ghosts].mean() == pytest.approx(20 * np.cos(np.arctan2(10, 38)), abs=0.5)
    without = scan(radars(**keys, guard_rail_reflection=0.0), world)
    assert not ((without["velocity"] > 5) & (xyz_of_returns(without)[:, 1] > 5)).any()


def test_rcs_by_class_and_aspect() -> None:
    labels = np.array([0, 0, 0, 3, 3])
    found_db = 10 * np.log10(road_user_rcs_m2(labels, np.array([0.0, np.pi / 2, np.pi / 4, 0.0, 1.0])))
    car, person = PATTERNS["car"], PATTERNS["pedestrian"]
    assert found_db[:2] == pytest.approx([car.end, car.side])
    assert found_db[2] == pytest.approx(car.between, abs=0.2)
    assert found_db[3:] == pytest.approx([person.end] * 2)


def test_a_tick_of_several_steps_scans_at_each_of_its_steps() -> None:
    one = radars(sensor_tick=0.3)
    world = BoxWorld(cars([(40, 0)]))
    assert [len(one.sense(instant(world, frame)).messages) for frame in range(4)] == [2, 0, 0, 2]
    assert Radars.cadences("ego", {"a": RadarSensor(sensor_tick=0.3)}, 0.1)["/ego/a/scan"].steps == 3


def test_same_seed_same_bytes_and_each_frame_draws_anew() -> None:
    world = BoxWorld(cars([(40, 0), (30, 5)]), rail_y_m=-4.0)
    keys = {"false_alarm_probability": 1e-4, "swerling": 1}
    first, second = (
        [one.sense(instant(world, frame)).messages[0][1] for frame in range(3)]
        for one in (radars(**keys), radars(**keys))
    )
    assert first == second
    assert len({cdr[20:] for cdr in first}) == 3


def test_what_is_in_view() -> None:
    section = RadarSensor(horizontal_fov=60.0, range=50.0)
    boxes = in_radar(cars([(40, 0), (60, 0), (20, 20), (20, 5)]))
    assert in_view(section, boxes).tolist() == [True, False, False, True]


def test_surfaces_are_the_classes_of_the_ray_casters_materials() -> None:
    assert SURFACES == SEMANTIC_CLASSES


class MeasuringWorld(BoxWorld):
    """A world whose own radars measure: a few places, with what it is told of the radar's velocity."""

    def radar_hits(self, name: str, radar_mps: np.ndarray) -> np.ndarray:
        assert name == "front"
        rate_mps = -radar_mps[0]
        return np.array(
            [[60, 0.1, 0.02, rate_mps], [20, -0.1, 0.02, rate_mps], [90, 0.0, 0.0, -75.0], [250, 0, 0, 0]]
        )


@pytest.mark.parametrize(("resolution_deg", "elevation"), [(0.0, 0.0), (2.0, 0.02)])
def test_a_world_may_measure_itself(resolution_deg: float, elevation: float) -> None:
    """Its hits, by range and in range, each with the power of a target of 1 m²."""
    one = radars(elevation_resolution_deg=resolution_deg, range=100.0)
    reading = one.sense(instant(MeasuringWorld(cars([(40, 0)])), velocity_mps=20.0))
    found = scan_from_cdr(reading.messages[0][1]).returns
    assert found["range"].tolist() == [20, 60, 90]
    assert found["azimuth"] == pytest.approx([-0.1, 0.1, 0.0])
    assert found["elevation"] == pytest.approx([elevation, elevation, 0.0])
    assert found["velocity"] == pytest.approx([-20, -20, 65])  # folded beyond 70 m/s
    assert found["amplitude"][0] - found["amplitude"][1] == pytest.approx(40 * np.log10(3), abs=1e-4)
    rcs = np.frombuffer(reading.messages[1][1][-1 - 3 * 24 : -1], "<f4").reshape(3, 6)[:, 4]
    assert rcs == pytest.approx(0, abs=1e-4)
    few = scan_from_cdr(
        radars(max_returns=1, range=100.0).sense(instant(MeasuringWorld(cars([(40, 0)])))).messages[0][1]
    )
    assert few.returns["range"].tolist() == [60]  # the first: their order is random


def test_what_a_world_lacks_for_radars() -> None:
    assert Radars.missing_from(frozenset({"road users", "radar hits"})) == []
    assert Radars.missing_from(frozenset({"road users", "scans"})) == ["rays"]
