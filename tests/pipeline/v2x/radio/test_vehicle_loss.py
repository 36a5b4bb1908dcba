"""Diffraction over vehicles against numbers worked by hand from ITU-R P.526, equation 31."""

from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.v2x.radio.vehicle_loss import Bodies, knife_edge_db, vehicle_loss_db

WAVELENGTH_M = 0.05
CAR, TRUCK = (4.5, 1.8, 1.5), (12.0, 2.5, 3.5)


def bodies(vehicles: list[tuple[float, float, float, tuple[float, float, float]]]) -> Bodies:
    """x, y, heading in degrees, size of each."""
    x, y, heading_deg, size_m = (np.array(column, np.float64) for column in zip(*vehicles, strict=True))
    turn = np.radians(heading_deg)
    forward = np.column_stack([np.cos(turn), np.sin(turn)])
    return Bodies(np.column_stack([x, y]), forward, size_m[:, :2] / 2, size_m[:, 2])


def loss_db(
    vehicles: list[tuple[float, float, float, tuple[float, float, float]]], antenna_m: float
) -> float:
    """From the first vehicle to the second; antennas at this height."""
    box = bodies(vehicles)
    places_m = np.column_stack([box.centre_m, np.full(len(vehicles), antenna_m)])
    wanted = np.zeros((1, len(vehicles)), np.bool_)
    wanted[0, 1] = True
    loss = vehicle_loss_db(places_m, box, np.array([0]), wanted, WAVELENGTH_M)
    assert np.count_nonzero(loss) <= 1
    return float(loss[0, 1])


@pytest.mark.parametrize(
    ("parameter", "expected_db"),
    [(0.0, 6.03), (1.0, 13.93), (2.4, 20.54), (-0.78, 0.0), (-3.0, 0.0), (-np.inf, 0.0)],
)
def test_single_edge(parameter: float, expected_db: float) -> None:
    """J(0) = 6.9 + 20 log10(sqrt(1.01) - 0.1) = 6.03; J(1) = 6.9 + 20 log10(sqrt(1.81) + 0.9) = 13.93;
    J(2.4) = 6.9 + 20 log10(sqrt(6.29) + 2.3) = 20.54."""
    assert float(knife_edge_db(np.array(parameter))) == pytest.approx(expected_db, abs=0.01)


def test_a_truck_in_the_middle() -> None:
    """2 m above the line, 50 m from both ends: v = 2 sqrt(2 * 100 / (0.05 * 50 * 50)) = 2 * 1.26491 = 2.5298;
    6.9 + 20 log10(sqrt(2.4298^2 + 1) + 2.4298) = 20.97 dB."""
    found = loss_db([(0, 0, 0, CAR), (100, 0, 0, CAR), (50, 0, 0, TRUCK)], 1.5)
    assert found == pytest.approx(20.97, abs=0.01)


def test_antennas_above_the_roof_clear_it() -> None:
    vehicles = [(0.0, 0.0, 0.0, CAR), (100.0, 0.0, 0.0, CAR), (50.0, 0.0, 0.0, CAR)]
    assert loss_db(vehicles, 2.5) == pytest.approx(0.0, abs=0.01)  # v = -1.26
    assert loss_db(vehicles, 1.5) == pytest.approx(6.03, abs=0.01)  # grazes it


@pytest.mark.parametrize(
    ("aside_m", "heading_deg", "is_obstacle"),
    [(1.2, 0, True), (1.3, 0, False), (5.9, 90, True), (6.1, 90, False), (-5.9, 90, True), (3.0, 45, True)],
)
def test_a_vehicle_is_an_obstacle_where_its_outline_is_between_the_antennas(
    aside_m: float, heading_deg: float, is_obstacle: bool
) -> None:
    """The truck is 12 m long and 2.5 m wide."""
    found = loss_db([(0, 0, 0, CAR), (100, 0, 0, CAR), (50, aside_m, heading_deg, TRUCK)], 1.5)
    assert (found > 0) == is_obstacle


def test_own_bodies_and_vehicles_beyond_are_no_obstacles() -> None:
    assert loss_db([(0, 0, 0, TRUCK), (100, 0, 0, TRUCK), (-20, 0, 0, TRUCK), (120, 0, 0, TRUCK)], 1.5) == 0.0


def test_two_trucks_are_bullingtons_equivalent_edge() -> None:
    """At 20 m and 80 m of 100 m, 2 m above the line: both slopes are 0.1, which meet 5 m above its middle:
    v = 5 * 1.26491 = 6.3246; 6.9 + 20 log10(sqrt(6.2246^2 + 1) + 6.2246) = 28.86 dB."""
    found = loss_db([(0, 0, 0, CAR), (100, 0, 0, CAR), (20, 0, 0, TRUCK), (80, 0, 0, TRUCK)], 1.5)
    expected = 6.9 + 20 * math.log10(math.hypot(6.2246, 1) + 6.2246)
    assert expected == pytest.approx(28.86, abs=0.01)
    assert found == pytest.approx(expected, abs=0.01)


def test_the_loss_is_the_same_both_ways() -> None:
    rng = np.random.default_rng(1)
    vehicles = [
        (float(rng.uniform(0, 200)), float(rng.uniform(-8, 8)), float(rng.uniform(0, 360)), size)
        for size in [CAR, TRUCK] * 15
    ]
    box = bodies(vehicles)
    places_m = np.column_stack([box.centre_m, rng.uniform(1.4, 1.6, 30)])
    loss = vehicle_loss_db(places_m, box, np.arange(30), np.ones((30, 30), np.bool_), WAVELENGTH_M)
    np.testing.assert_allclose(loss, loss.T, atol=1e-6)
    assert np.mean(loss > 6) > 0.3
    assert not np.diag(loss).any()
