"""One radar and targets placed by hand: range, Doppler, power, resolution, ambiguity, false alarms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from advpipe.pipeline.messages.radar import RadarReturns
from advpipe.pipeline.sensors.radar.radar import Radar
from advpipe.pipeline.sensors.radar.scatterers import Scatterers
from advpipe.pipeline.sensors.radar.section import RadarSensor

STILL = np.zeros(3)


def radar(**keys: Any) -> Radar:
    quiet = {"false_alarm_probability": 1e-12, "ground_reflection": 0.0, "swerling": 0, "range": 200.0}
    return Radar(RadarSensor(**{**quiet, "detection_range_m": 500.0, **keys}), 0.1)


def targets(*positions_m: tuple[float, float, float], velocity_mps: Any = (0, 0, 0), rcs_m2: float = 10.0):
    place_m = np.array(positions_m, float)
    count = len(place_m)
    velocities = np.broadcast_to(np.array(velocity_mps, float), (count, 3))
    return Scatterers(place_m, velocities, np.full(count, rcs_m2), np.zeros(count), np.zeros(count, np.int64))


def scan(one: Radar, scene: Scatterers, velocity_mps: Any = STILL, seed: int = 0) -> RadarReturns:
    return one.measure(scene, np.asarray(velocity_mps, float), np.random.default_rng(seed))


def test_range_azimuth_and_doppler_of_one_target() -> None:
    """At (40, 30) m: 50 m away, 36.87 degrees to the left. It drives 10 m/s along x and the radar 25: along
    the line of sight, (10 - 25) * 0.8 = -12 m/s, so it comes nearer."""
    (found,) = scan(radar(horizontal_fov=90.0), targets((40, 30, 0), velocity_mps=(10, 0, 0)), (25, 0, 0))
    assert found["range"] == pytest.approx(50.0, abs=0.1)
    assert np.rad2deg(found["azimuth"]) == pytest.approx(36.87, abs=0.3)
    assert found["velocity"] == pytest.approx(-12.0, abs=0.03)
    assert found["elevation"] == 0.0  # this radar measures none


def test_ego_motion_cancels_for_what_stands_still() -> None:
    scene = targets((30, 10, 0), (50, -20, 0), (90, 5, 0))
    velocity_mps = np.array([20.0, 1.0, 0.0])
    found = scan(radar(horizontal_fov=60.0), scene, velocity_mps)
    ahead = np.stack([np.cos(found["azimuth"]), np.sin(found["azimuth"]), 0 * found["azimuth"]], axis=1)
    assert len(found) == 3
    assert np.abs(found["velocity"] + ahead @ velocity_mps).max() < 0.15


def test_power_falls_with_the_fourth_power_of_range() -> None:
    """Twice as far: 12.04 dB less; the stated RCS stays."""
    one = radar()
    near, far = (scan(one, targets((range_m, 0, 0))) for range_m in (50.0, 100.0))
    assert near["amplitude"][0] - far["amplitude"][0] == pytest.approx(12.04, abs=0.3)
    for found in (near, far):
        assert one.rcs_dbsm(found)[0] == pytest.approx(10.0, abs=0.3)


@pytest.mark.parametrize(
    ("dimension", "keys", "second"),
    [
        ("range", {"range_resolution_m": 2.0}, lambda cells: (40 + 2.0 * cells, 0, 0)),
        ("azimuth", {"azimuth_resolution_deg": 3.0}, lambda cells: _at(40, 3.0 * cells, 0)),
        ("elevation", {"elevation_resolution_deg": 2.0}, lambda cells: _at(40, 0, 2.0 * cells)),
    ],
)
def test_resolution_separates_two_cars_as_it_should(dimension: str, keys: Any, second: Any) -> None:
    one = radar(**keys)
    counts = {
        cells: np.mean([len(scan(one, targets((40, 0, 0), second(cells)), seed=s)) for s in range(20)])
        for cells in (0.4, 1.3)
    }
    assert counts == {0.4: 1, 1.3: 2}, dimension


def _at(range_m: float, azimuth_deg: float, elevation_deg: float) -> tuple[float, float, float]:
    azimuth, elevation = np.deg2rad([azimuth_deg, elevation_deg])
    level_m = range_m * np.cos(elevation)
    return float(level_m * np.cos(azimuth)), float(level_m * np.sin(azimuth)), range_m * np.sin(elevation)


def test_doppler_separates_what_range_and_angle_do_not() -> None:
    scene = targets((40, 0, 0)) + targets((40.2, 0, 0), velocity_mps=(1, 0, 0))
    assert len(scan(radar(velocity_resolution_mps=2.0), scene)) == 1
    assert len(scan(radar(velocity_resolution_mps=0.5), scene)) == 2


def test_velocity_and_azimuth_fold_into_what_is_unambiguous() -> None:
    """30 m/s with +-20 m/s: -10. 50 degrees with +-30: sin = 0.766, minus 1: -13.5 degrees."""
    (fast,) = scan(radar(max_velocity_mps=20.0), targets((40, 0, 0), velocity_mps=(30, 0, 0)))
    assert fast["velocity"] == pytest.approx(-10.0, abs=0.05)
    beside = targets(_at(40, 50, 0))
    (folded,) = scan(radar(horizontal_fov=120.0, unambiguous_azimuth_deg=30.0), beside)
    assert np.rad2deg(folded["azimuth"]) == pytest.approx(-13.5, abs=0.5)
    (plain,) = scan(radar(horizontal_fov=120.0), beside)
    assert np.rad2deg(plain["azimuth"]) == pytest.approx(50.0, abs=0.5)


def test_what_is_out_of_range_or_view_is_not_measured() -> None:
    assert len(scan(radar(range=60.0), targets((70, 0, 0)))) == 0
    assert len(scan(radar(horizontal_fov=30.0), targets(_at(40, 20, 0)))) == 0


def test_false_alarms_are_as_many_as_the_threshold_says() -> None:
    """66 ranges by 1400 velocities at 1e-4: 9.24 a scan."""
    one = radar(range=50.0, range_resolution_m=0.75, false_alarm_probability=1e-4, max_returns=1000)
    empty = Scatterers(*_no_scatterers())
    found = [scan(one, empty, seed=seed) for seed in range(300)]
    assert one.section.cells == 66 * 1400
    assert stats.binomtest(sum(map(len, found)), 300 * one.section.cells, 1e-4).pvalue > 1e-3
    everywhere = np.concatenate(found)
    assert stats.kstest(everywhere["range"], stats.uniform(0, 50).cdf).pvalue > 1e-3
    assert stats.kstest(everywhere["velocity"], stats.uniform(-70, 140).cdf).pvalue > 1e-3


def _no_scatterers() -> tuple[Any, ...]:
    none = np.zeros(0)
    return np.zeros((0, 3)), np.zeros((0, 3)), none, none, np.zeros(0, np.int64)


def test_errors_are_those_of_the_signal() -> None:
    """The standard deviation is the cell's width over sqrt(2 SNR), here of 20 dB: 0.75 m / 14.1."""
    one = radar()
    expected_m = 0.75 / np.sqrt(2 * 100)
    rcs_m2 = 100 / float(one.propagation.snr_of_1m2(np.array([50.0]), np.zeros(1), np.zeros(1))[0])
    ranges = [scan(one, targets((50, 0, 0), rcs_m2=rcs_m2), seed=seed)["range"][0] for seed in range(300)]
    assert np.mean(ranges) == pytest.approx(50.0, abs=0.01)
    assert np.std(ranges) == pytest.approx(expected_m, rel=0.15)


def test_the_list_keeps_the_largest_targets_by_range() -> None:
    scene = targets(*((20.0 + 4 * i, 0.0, 0.0) for i in range(10)), rcs_m2=1.0)
    scene.rcs_m2[[2, 7]] = 100.0
    found = scan(radar(max_returns=2), scene)
    assert found["range"] == pytest.approx([28.0, 48.0], abs=0.1)


def test_same_seed_same_bytes() -> None:
    one, scene = radar(swerling=1, false_alarm_probability=1e-4), targets((40, 0, 0), (60, 5, 0))
    assert scan(one, scene, seed=3).tobytes() == scan(one, scene, seed=3).tobytes()
    assert scan(one, scene, seed=3).tobytes() != scan(one, scene, seed=4).tobytes()
