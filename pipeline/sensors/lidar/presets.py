"""Well-known LiDARs: the keys that `preset` sets in a LidarSensor.

All values are published by the manufacturers; each entry names its source. Individual sensors differ, and
these are nominal values: the design table of the elevations, no azimuth offsets between channels, single
returns, 10 turns a second. `noise_stddev` is the published range accuracy, taken as one standard deviation.
`range_reflectivity` is the reflectivity for which the manufacturer states the range; where a Velodyne data
sheet states none, it is HDL-64E's 80 %. Intensity is calibrated reflectivity, as these sensors report it:
clear air attenuates it by exp(-0.0003 d), a visibility of 20 km, and returns are lost only by their signal.
They report it in 256 steps. HDL-64E is older, and its intensities are those of KITTI's frames: a compressed
scale in hundredths, and 0 for weak returns.
"""

from __future__ import annotations

from typing import Any

_CALIBRATED: dict[str, Any] = {
    "rotation_frequency": 10.0,
    "atmosphere_attenuation_rate": 0.0003,
    "dropoff_general_rate": 0.0,
    "dropoff_intensity_limit": 0.0,
    "dropoff_zero_intensity": 0.0,
    "intensity_response": {"levels": 255},
}

_KITTI: dict[str, Any] = {
    "intensity_response": {
        "scale": 0.63, "exponent": 0.4, "threshold": 0.032, "threshold_range_m": 80.0, "levels": 100
    }
}  # fmt: skip
"""Fitted to 38 frames of KITTI's Velodyne HDL-64E: intensity on all points .255 on average (5, 50 and 95 %:
0, .28 and .48), .248 on the ground, .11 (median 0) on cars, and exactly 0 on 13 % of the points."""


def _even(lowest_deg: float, step_deg: float, channels: int) -> tuple[float, ...]:
    return tuple(round(lowest_deg + step_deg * channel, 3) for channel in range(channels))


def _preset(
    angles_deg: tuple[float, ...], points_per_second: int, range_m: float, reflectivity: float, noise_m: float
) -> dict[str, Any]:
    return _CALIBRATED | {
        "channels": len(angles_deg),
        "lower_fov": angles_deg[0],
        "upper_fov": angles_deg[-1],
        "vertical_angles_deg": angles_deg,
        "points_per_second": points_per_second,
        "range": range_m,
        "range_reflectivity": reflectivity,
        "noise_stddev": noise_m,
    }


_VLP_32C = (
    -25.0, -15.639, -11.31, -8.843, -7.254, -6.148, -5.333, -4.667, -4.0, -3.667, -3.333, -3.0, -2.667,
    -2.333, -2.0, -1.667, -1.333, -1.0, -0.667, -0.333, 0.0, 0.333, 0.667, 1.0, 1.333, 1.667, 2.333, 3.333,
    4.667, 7.0, 10.333, 15.0,
)  # fmt: skip

_PANDAR_64 = (
    -24.897, -18.889, -13.93, -12.974, -12.006, -11.032, -9.885, -9.06, -8.059, -7.063, -6.061, -5.898,
    -5.726, -5.565, -5.391, -5.229, -5.057, -4.892, -4.72, -4.558, -4.385, -4.221, -4.05, -3.884, -3.712,
    -3.548, -3.375, -3.21, -3.04, -2.873, -2.7, -2.536, -2.365, -2.198, -2.028, -1.86, -1.688, -1.522,
    -1.351, -1.184, -1.013, -0.845, -0.675, -0.508, -0.337, -0.169, 0.0, 0.169, 0.337, 0.508, 0.675, 0.846,
    1.013, 1.184, 1.351, 1.522, 1.688, 1.86, 2.028, 3.04, 5.057, 8.059, 11.032, 14.882,
)  # fmt: skip

_PANDAR_128 = (
    -25.016, -24.123, -23.678, -23.219, -22.768, -22.304, -21.848, -21.379, -20.918, -20.445, -19.978,
    -19.501, -19.03, -18.548, -18.072, -17.592, -17.106, -16.622, -16.135, -15.645, -15.154, -14.66, -14.166,
    -13.67, -13.173, -12.673, -12.174, -11.672, -11.17, -10.665, -10.16, -9.652, -9.149, -8.64, -8.134,
    -7.624, -7.117, -6.607, -6.1, -5.968, -5.843, -5.718, -5.589, -5.463, -5.336, -5.209, -5.081, -4.951,
    -4.824, -4.699, -4.571, -4.444, -4.318, -4.19, -4.062, -3.933, -3.806, -3.68, -3.552, -3.425, -3.299,
    -3.172, -3.044, -2.916, -2.789, -2.663, -2.535, -2.409, -2.282, -2.155, -2.027, -1.901, -1.773, -1.646,
    -1.519, -1.393, -1.266, -1.141, -1.012, -0.887, -0.76, -0.632, -0.506, -0.38, -0.254, -0.129, 0.0, 0.124,
    0.251, 0.379, 0.505, 0.63, 0.756, 0.88, 1.008, 1.13, 1.258, 1.386, 1.511, 1.637, 1.761, 1.885, 2.013,
    2.512, 3.013, 3.509, 4.007, 4.501, 4.996, 5.487, 5.978, 6.467, 6.953, 7.438, 7.921, 8.401, 8.88, 9.356,
    9.83, 10.305, 10.771, 11.239, 11.702, 12.165, 12.624, 13.082, 13.535, 14.436,
)  # fmt: skip

LIDAR_PRESETS: dict[str, dict[str, Any]] = {
    # Velodyne VLP-16 (Puck) datasheet 63-9229 and user manual 63-9243: 903 nm; one firing cycle of
    # 55.296 us, +-3 cm.
    "vlp-16": _preset(_even(-15.0, 2.0, 16), 289_352, 100.0, 0.8, 0.03),
    # Velodyne HDL-32E datasheet 97-0038 and user manual 63-9113: 903 nm; one cycle of 46.08 us, +-2 cm.
    "hdl-32e": _preset(_even(-30.667, 4 / 3, 32), 694_444, 100.0, 0.8, 0.02),
    # Velodyne VLP-32C (Ultra Puck) datasheet 63-9378 and user manual 63-9325, table 9-2: 903 nm; one
    # cycle of 55.296 us, +-3 cm.
    "vlp-32c": _preset(_VLP_32C, 578_703, 200.0, 0.8, 0.03),
    # Velodyne HDL-64E S2 and S3 user manual 63-HDL64ES3: 905 nm; a lower block by 1/2 and an upper block by
    # 1/3 of a degree, 120 m for a reflectivity of 0.8 and 50 m for 0.1, of which the
    # latter, 0.576 at 120 m by the square of the range, is what dark cars are seen by; under 2 cm.
    "hdl-64e": _preset(
        _even(-24.333, 0.5, 32) + _even(-8.333, 1 / 3, 32), 1_333_312, 120.0, 0.576, 0.02
    ) | _KITTI,
    # Ouster OS1 datasheet, first generation: 850 nm; 120 m for a target of 80 % (40 m for 10 %), 1024
    # columns, 1.5 to 10 cm by the signal; 64 channels over +-16.611 degrees, 128 over +-22.5 degrees.
    "os1-64": _preset(_even(-16.611, 33.222 / 63, 64), 655_360, 120.0, 0.8, 0.03),
    "os1-128": _preset(_even(-22.5, 45 / 127, 128), 1_310_720, 120.0, 0.8, 0.03),
    # Hesai Pandar64 user manual 640-en: 905 nm; channel distribution, 200 m for 10 %, +-2 cm, 0.2 degrees.
    "pandar64": _preset(_PANDAR_64, 1_152_000, 200.0, 0.1, 0.02),
    # Hesai Pandar128E3X user manual 128-en: 905 nm; channel distribution, 200 m for 10 %, +-2 cm, 0.2 degrees
    # for every channel (its finer modes turn some of them twice as fine).
    "pandar128": _preset(_PANDAR_128, 2_304_000, 200.0, 0.1, 0.02),
}  # fmt: skip
"""The keys of a LidarSensor that each preset sets, by the preset's name."""
