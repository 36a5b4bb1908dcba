"""Well-known kinds of radars: the keys that `preset` sets in a RadarSensor.

The values are nominal ones of the manufacturers' data sheets; what no data sheet states (the range for a
target of 10 m², the false alarm rate) is chosen so that the published maximum ranges of cars result.
"""

from __future__ import annotations

from typing import Any

RADAR_PRESETS: dict[str, dict[str, Any]] = {
    # Continental ARS 408-21 data sheet, far scan: 76 to 77 GHz, 0.2 to 250 m, +-9 degrees (a narrow beam of
    # 1.6 degrees), 1.79 m, 0.1 m/s from -400 to +200 km/h, no elevation, 14 degrees high, 250 clusters.
    "long-range": {
        "horizontal_fov": 18.0,
        "vertical_fov": 14.0,
        "range": 250.0,
        "points_per_second": 6_000,
        "frequency_ghz": 76.5,
        "range_resolution_m": 1.79,
        "azimuth_resolution_deg": 1.6,
        "elevation_resolution_deg": 0.0,
        "velocity_resolution_mps": 0.1,
        "max_velocity_mps": 83.0,
        "detection_range_m": 220.0,
        "false_alarm_probability": 1e-6,
        "max_returns": 250,
    },
    # Bosch corner radar (fifth generation) and Continental SRR 520 data sheets: 76 to 77 GHz, +-75 degrees,
    # 100 m (160 m of large targets), 0.4 m, 0.1 m/s; a beam of some 8 degrees by few antennas.
    "corner": {
        "horizontal_fov": 150.0,
        "vertical_fov": 12.0,
        "range": 100.0,
        "points_per_second": 8_000,
        "frequency_ghz": 76.5,
        "range_resolution_m": 0.4,
        "azimuth_resolution_deg": 8.0,
        "elevation_resolution_deg": 0.0,
        "velocity_resolution_mps": 0.1,
        "max_velocity_mps": 35.0,
        "detection_range_m": 90.0,
        "false_alarm_probability": 1e-6,
        "max_returns": 128,
    },
    # Continental ARS 540 as published: 76 to 77 GHz, 300 m, +-60 degrees by 1.2, elevation by 2.3 degrees;
    # range by 0.3 m and 0.1 m/s as Arbe states for its Phoenix.
    "imaging-4d": {
        "horizontal_fov": 120.0,
        "vertical_fov": 30.0,
        "range": 300.0,
        "points_per_second": 80_000,
        "frequency_ghz": 76.5,
        "range_resolution_m": 0.3,
        "azimuth_resolution_deg": 1.2,
        "elevation_resolution_deg": 2.3,
        "velocity_resolution_mps": 0.1,
        "max_velocity_mps": 70.0,
        "detection_range_m": 260.0,
        "false_alarm_probability": 1e-6,
        "max_returns": 2000,
        "scatterers": 48,
    },
}
"""The keys of a RadarSensor that each preset sets, by the preset's name."""
