"""The reported intensity, against numbers worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.lidar.response import IntensityResponse
from advpipe.pipeline.sensors.lidar.section import LidarSensor


def reported(response: IntensityResponse, signal: float, range_m: float = 0.0) -> float:
    return float(response.intensity(np.array([signal], np.float32), np.array([range_m], np.float32))[0])


def test_by_default_the_intensity_is_the_signal_up_to_1() -> None:
    assert reported(IntensityResponse(), 0.123) == pytest.approx(0.123)
    assert reported(IntensityResponse(), 220.0) == 1.0


def test_a_curve_with_threshold_and_steps() -> None:
    # 0.5 x sqrt(0.16) = 0.2; sqrt(0.15) x 0.5 = 0.19365, which is 19 hundredths.
    response = IntensityResponse(scale=0.5, exponent=0.5, threshold=0.1, threshold_range_m=50, levels=100)
    assert reported(response, 0.16) == pytest.approx(0.20)
    assert reported(response, 0.15) == pytest.approx(0.19)
    assert reported(response, 0.099) == 0.0
    # At 50 m the threshold has doubled to 0.2, at 100 m it is 0.1 x (1 + 4) = 0.5.
    assert reported(response, 0.19, 50.0) == 0.0
    assert reported(response, 0.21, 50.0) == pytest.approx(0.23)  # 0.5 sqrt 0.21 = 0.2291
    assert reported(response, 0.49, 100.0) == 0.0
    assert reported(response, 220.0, 100.0) == 1.0


def test_hdl_64e_reports_kittis_intensities() -> None:
    response = LidarSensor(preset="hdl-64e").intensity_response
    # Asphalt (0.14) at 70 degrees: 0.14 x (0.342 + 0.2992 x 0.883) = 0.0849; 0.63 x 0.0849^0.4 = 0.2350.
    assert reported(response, 0.0849, 5.0) == pytest.approx(0.23)
    # Black paint at 60 degrees: 0.06 x (0.5 + 0.2992 x 0.75) = 0.0435, of which gloss leaves 5 %.
    assert reported(response, 0.05 * 0.0435, 5.0) == 0.0


def test_other_presets_report_calibrated_reflectivity_in_256_steps() -> None:
    response = LidarSensor(preset="os1-64").intensity_response
    assert reported(response, 0.3) == pytest.approx(76 / 255)  # 76.5 is rounded to even
    assert LidarSensor().intensity_response.is_linear
