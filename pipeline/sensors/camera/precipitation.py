"""Rain drops and snow flakes in the air near a camera, as streaks of the exposure time.

Their number follows the size distributions of the LiDAR's air (Marshall and Palmer 1948; Gunn and Marshall
1958); drops fall at their terminal velocity (Atlas and Ulbrich 1977), flakes at 1 m/s.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.lens import Lens
from advpipe.pipeline.sensors.weather import Weather

Float32 = npt.NDArray[np.float32]

FAR_M = {"rain": 2.5, "snow": 5.0}
"""Distance up to which single particles are seen; farther ones are a veil."""

NEAR_M = {"rain": 0.25, "snow": 0.9}
"""Nearer ones pass by unseen: they are out of focus."""

HALF_VIEW = np.tan(np.deg2rad(50))
FOCUS_M = 1.0
MOST = 12_000
VISIBLE_MM = 1.2
"""Particles from this diameter on, of water, are drawn."""


def draw_particles(
    radiance: Float32,
    lens: Lens,
    weather: Weather,
    optical_velocity_mps: Float64,
    down: Float64,
    exposure_s: float,
    light: Float32,
    rng: np.random.Generator,
) -> None:
    """Draw the particles of rain or snow into a radiance (3, H, W).

    optical_velocity_mps, down: (3,) the camera's velocity and the direction of gravity, in its optical frame.
    light: (3,) luminance of the sky, of which a drop sends on 94 % (Garg and Nayar 2007).
    """
    from PIL import Image, ImageDraw

    if weather.kind not in ("rain", "snow"):
        return
    density, slope_per_mm = _distribution(weather)
    far_m = FAR_M[weather.kind]
    volume_m3 = (2 * HALF_VIEW) ** 2 * far_m**3 / 3
    expected = density / slope_per_mm * np.exp(-slope_per_mm * VISIBLE_MM) * volume_m3
    count = min(int(rng.poisson(min(expected, 1e6))), MOST)
    depth_m = np.maximum(far_m * np.cbrt(rng.random(count)), NEAR_M[weather.kind])
    across = rng.uniform(-HALF_VIEW, HALF_VIEW, (count, 2)) * depth_m[:, None]
    places = np.column_stack([across, depth_m])
    diameter_mm = VISIBLE_MM + rng.exponential(1 / slope_per_mm, count)
    is_snow = weather.kind == "snow"
    if is_snow:
        diameter_mm *= 4.0  # a flake is wider than the drop that it melts to
        fall_mps = np.full(count, 1.0)
        sway = rng.normal(0, 0.4, (count, 3))
    else:
        fall_mps = np.maximum(9.65 - 10.3 * np.exp(-0.6 * diameter_mm), 0.5)
        sway = np.zeros((count, 3))
    move = (fall_mps[:, None] * down + sway - optical_velocity_mps) * exposure_s
    starts, ends = lens.project(places), lens.project(places + move)
    # Nearer than a metre, they are out of focus: wider, and fainter.
    sharp_px = diameter_mm * 1e-3 * lens.matrix[0, 0] / places[:, 2]
    width_px = sharp_px + np.maximum(FOCUS_M / places[:, 2] - 1, 0.0)
    length_px = np.linalg.norm(ends - starts, axis=1)
    bright = 0.8 if is_snow else 0.94
    share = bright * np.minimum(sharp_px, 1) * sharp_px / (width_px + length_px)
    share = np.minimum(share, 0.6)
    height, wide = radiance.shape[1:]
    mask = Image.new("L", (wide, height))
    pen = ImageDraw.Draw(mask)
    drawn = np.isfinite(starts).all(axis=1) & np.isfinite(ends).all(axis=1) & (share * 255 >= 1)
    for index in np.flatnonzero(drawn):
        line = [*starts[index].tolist(), *ends[index].tolist()]
        size = max(round(float(width_px[index])), 1)
        level = int(share[index] * 255)
        pen.line(line, fill=level, width=size)
        if size > 1:  # round ends
            for x, y in (line[:2], line[2:]):
                pen.ellipse((x - size / 2, y - size / 2, x + size / 2, y + size / 2), fill=level)
    cover = np.asarray(mask, np.float32) * np.float32(1 / 255)
    radiance += cover * ((light * np.float32(1.4 if is_snow else 1.0))[:, None, None] - radiance)


def _distribution(weather: Weather) -> tuple[float, float]:
    """Density in 1/(m^3 mm) and slope in 1/mm of N(D) = density exp(-slope D)."""
    rate = weather.rate_mm_per_h
    if weather.kind == "rain":
        return 8000.0, 4.1 * rate**-0.21
    return 3.8e3 * rate**-0.87, 2.55 * rate**-0.48
