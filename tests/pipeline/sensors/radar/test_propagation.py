"""The radar equation, the road's reflection and rain, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.radar.detection import detection_probability
from advpipe.pipeline.sensors.radar.propagation import Propagation
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.pipeline.sensors.weather import Weather

ZERO = np.zeros(1)
CLEAR = Weather()


def snr(propagation: Propagation, range_m: float, azimuth_deg: float = 0.0) -> float:
    return float(propagation.snr_of_1m2(np.array([range_m]), np.deg2rad([azimuth_deg]), ZERO)[0])


def test_the_stated_target_is_detected_as_stated() -> None:
    section = RadarSensor(detection_range_m=120.0, false_alarm_probability=1e-5, cfar_cells=16)
    at_range = 10 * snr(Propagation(section, CLEAR), 120.0)
    assert detection_probability(at_range, 1e-5, 16) == pytest.approx(0.9)


def test_power_falls_with_the_fourth_power_of_range() -> None:
    propagation = Propagation(RadarSensor(), CLEAR)
    assert snr(propagation, 30.0) / snr(propagation, 60.0) == pytest.approx(16)


def test_the_edge_of_the_field_of_view_has_half_the_gain_each_way() -> None:
    propagation = Propagation(RadarSensor(horizontal_fov=40.0), CLEAR)
    assert snr(propagation, 50.0, 20.0) / snr(propagation, 50.0) == pytest.approx(1 / 4)


def test_rain_attenuates_both_ways() -> None:
    """10 mm/h: 1.13 * 10^0.714 = 5.85 dB/km; 200 m there and back: 2.34 dB."""
    wet = Propagation(RadarSensor(), Weather(kind="rain", rate_mm_per_h=10.0))
    loss_db = 10 * np.log10(snr(Propagation(RadarSensor(), CLEAR), 200.0) / snr(wet, 200.0))
    assert loss_db == pytest.approx(2.34, abs=0.01)


def test_the_roads_reflection_makes_peaks_and_nulls() -> None:
    """The ways differ by 2 h h' / R. At half a wavelength, the reflection, turned by half a turn, adds up."""
    section = RadarSensor(ground_reflection=0.5, z_m=0.5, frequency_ghz=76.5)
    wavelength_m, range_m = 299_792_458 / 76.5e9, 100.0
    heights_m = np.array([0.5, 1.0]) * wavelength_m * range_m / (2 * 0.5)
    peak, null = Propagation(section, CLEAR).ground_factor(np.full(2, range_m), heights_m)
    grazing = (0.5 + heights_m) / range_m
    rho = 0.5 * np.exp(-2 * (2 * np.pi / wavelength_m * 0.3e-3 * grazing) ** 2)
    assert peak == pytest.approx((1 + rho[0]) ** 4)
    assert null == pytest.approx((1 - rho[1]) ** 4)
    assert 4.9 < peak < 5.1 > 0.065 > null  # nearly 1.5^4 and 0.5^4
    none = RadarSensor(ground_reflection=0.0)
    assert (Propagation(none, CLEAR).ground_factor(np.full(2, range_m), heights_m) == 1).all()
