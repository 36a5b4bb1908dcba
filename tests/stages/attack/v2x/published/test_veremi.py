"""VeReMi's numbers, as its `AttackerApp` and `omnetpp.ini` have them."""

from __future__ import annotations

import numpy as np
import pytest
from published_attacks import MANY, claims, presets, published
from v2x_lane import edited, lane, time_s

DRIVE = lane({1: 0.0, 2: 50.0}, 20)
FLEET = lane({number: 5.0 * number for number in MANY}, 12)
FRONT_M = 2.25


def offsets_m(found):
    """Of claims, one per step, from the true front."""
    true_m = [(FRONT_M + index, 0.0) for index in range(len(found))]
    return np.array([report.front_m[:2] for _, report in found]) - true_m


def test_every_row_of_the_catalogue_has_a_preset():
    numbers = {
        "cam-position-constant": 1,
        "cam-position-offset": 2,
        "cam-position-random": 4,
        "cam-position-random-offset": 8,
        "cam-eventual-stop": 16,
        "cam-speed-constant": 32,
        "cam-speed-random-offset": 64,
    }
    assert presets("veremi").keys() == numbers.keys()
    assert all(one.remark for one in presets("veremi").values())


def test_one_place():
    for _, report in claims(published("cam-position-constant", "veremi"), DRIVE):
        assert report.front_m[:2] == pytest.approx([5560, 5820], abs=0.02)


def test_one_offset_east_and_in_veins_to_the_north():
    """Its y axis points south: -150 there."""
    found = offsets_m(claims(published("cam-position-offset", "veremi"), DRIVE))
    assert found == pytest.approx(np.tile([250.0, 150.0], (20, 1)), abs=0.02)


def test_random_places_of_the_whole_road_network(road):
    drive = lane({1: 0.0}, 200)
    found = claims(published("cam-position-random", "veremi", roads=road), drive)
    places_m = np.array([report.front_m[:2] for _, report in found])
    assert places_m.min(axis=0) == pytest.approx([-100, 0], abs=30)
    assert places_m.max(axis=0) == pytest.approx([900, 9], abs=30)
    assert (places_m.min(axis=0) >= [-100.1, -0.1]).all()
    assert (places_m.max(axis=0) <= [900.1, 9.1]).all()


def test_random_offsets_of_up_to_300_m_along_both_axes():
    found = np.abs(offsets_m(claims(published("cam-position-random-offset", "veremi"), lane({1: 0.0}, 200))))
    assert 290 < found.max() <= 300.1
    assert found.mean() == pytest.approx(150, abs=20)


def test_its_constant_speed_is_zero():
    found = claims(published("cam-speed-constant", "veremi"), DRIVE)
    assert {cam.speed_mps for cam, _ in found} == {0.0}


def test_a_speed_offset_is_one_of_the_velocity():
    """10 m/s to the east, and up to 10 m/s along both axes: 22.36 m/s at most."""
    found = claims(published("cam-speed-random-offset", "veremi"), lane({1: 0.0}, 300))
    speeds_mps = np.array([cam.speed_mps for cam, _ in found])
    assert speeds_mps.max() <= 22.37
    assert speeds_mps.max() > 20.0  # which no offset of the speed alone reaches
    assert speeds_mps.min() < 4.0


def test_the_probability_of_a_stop_grows_with_each_tenth_of_a_second():
    """0.025 k at the k-th message: of 40 attackers, 13 draw a stop in the first five, 34 in the first 11."""
    attack = published("cam-eventual-stop", "veremi", attackers=MANY)
    stopped_at = {}
    true = {(one.station_id, one.request_ns): one.payload for step in FLEET for one in step.sent}
    for one in edited(attack, FLEET):
        if true[one.station_id, one.request_ns] != one.payload:
            stopped_at.setdefault(one.station_id, time_s(one.request_ns) - one.station_id * 0.002)
    by_the_fifth = sum(at_s < 0.55 for at_s in stopped_at.values())
    assert 5 <= by_the_fifth <= 22
    assert 26 <= len(stopped_at) <= 40


def test_it_stops_in_its_position_alone():
    found = claims(published("cam-eventual-stop", "veremi"), lane({1: 0.0}, 60))
    places_m = [round(report.front_m[0], 1) for _, report in found]
    (stop,) = [index for index in range(1, 60) if places_m[index] == places_m[index - 1]][:1]
    assert set(places_m[stop:]) == {places_m[stop]}
    assert places_m[stop] == pytest.approx(FRONT_M + stop - 1, abs=0.06)
    assert {cam.speed_mps for cam, _ in found} == {10.0}
