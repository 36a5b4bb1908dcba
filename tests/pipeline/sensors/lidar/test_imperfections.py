"""Range errors, ring errors, gloss, relief and wet ground, against numbers worked by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.sensors.lidar.imperfections import IDEAL, Imperfections
from advpipe.pipeline.sensors.lidar.intensity import gloss_lobe, wet_share
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import SURFACES, Hits, SurfaceDetail

RAYS = 40_000
ONE_RING = {"channels": 1, "upper_fov": 1, "lower_fov": 0, "points_per_second": RAYS * 10}
QUIET = {"noise_stddev": 0.0, "dropoff_general_rate": 0.0, "dropoff_intensity_limit": 0.0}


@dataclass(frozen=True)
class DetailedHits(Hits):
    """Hits of one surface with the same detail everywhere."""

    texture: float = 1.0
    relief_m: float = 0.0
    gloss: float = 0.0
    surface: str = "road"

    @property
    def surfaces(self) -> np.ndarray:
        return np.full(len(self.range_m), SURFACES.index(self.surface), np.uint8)

    def detail(self) -> SurfaceDetail:
        each = (self.texture, self.relief_m, self.gloss)
        return SurfaceDetail(*(np.full(len(self.range_m), value, np.float32) for value in each))


def surface(range_m: float, cos: float, reflectivity: float, **detail: object) -> DetailedHits:
    full = [np.full(RAYS, value, np.float32) for value in (range_m, cos, reflectivity)]
    return DetailedHits(
        *full, np.zeros(RAYS, bool), np.ones(RAYS, np.float32), np.full(RAYS, -1, np.int32),
        np.zeros(0, np.float32), **detail,  # type: ignore[arg-type]
    )  # fmt: skip


def cloud(hits: Hits, weather: Weather | None = None, preset: str | None = None, **real: object) -> Cloud:
    keys = {"preset": preset, "atmosphere_attenuation_rate": 0.0, "intensity_response": {}} | ONE_RING | QUIET
    imperfections = Imperfections.model_validate(IDEAL.model_dump() | real)
    sensor = LidarSensor.model_validate(keys | {"imperfections": imperfections})
    return Lidar(sensor, weather=weather).measure(hits, np.random.default_rng(0))


def ranges_m(points: Cloud) -> np.ndarray:
    return np.linalg.norm(xyz(points), axis=1)


def test_a_weak_return_is_less_exact() -> None:
    # HDL-64E needs 0.576 (30 / 120)^2 = 0.036 at 30 m; 0.2 is 5.56 times that: 0.064 / sqrt 5.56.
    found_m = ranges_m(cloud(surface(30, 1, 0.2), preset="hdl-64e", weak_noise_m=0.064))
    assert found_m.std() == pytest.approx(0.02715, rel=0.03)
    near_m = ranges_m(cloud(surface(5, 1, 0.2), preset="hdl-64e", weak_noise_m=0.064))
    assert near_m.std() == pytest.approx(0.02715 / 6, rel=0.03)


def test_a_slanted_surface_blurs_the_range() -> None:
    # A beam of 0.18 degrees is 6.28 cm wide at 20 m, and 6.28 x tan 80 = 35.6 cm deep: 5 % of that.
    found_m = ranges_m(cloud(surface(20, float(np.cos(np.deg2rad(80))), 0.5), beam_divergence_deg=0.18))
    assert found_m.std() == pytest.approx(0.05 * 0.3563, rel=0.03)


def test_relief_and_texture_act_and_can_be_turned_off() -> None:
    # A bump of 1 cm at 60 degrees is 2 cm nearer along the ray; at 85 degrees, 1 / 0.25 = 4 cm.
    bumpy = surface(10, 0.5, 0.4, relief_m=0.01, texture=0.8)
    assert ranges_m(cloud(bumpy, relief=True)) == pytest.approx(9.98, abs=1e-4)
    flat = surface(10, float(np.cos(np.deg2rad(85))), 0.4, relief_m=0.01)
    assert ranges_m(cloud(flat, relief=True)) == pytest.approx(9.96, abs=1e-4)
    assert ranges_m(cloud(bumpy)) == pytest.approx(10.0, abs=1e-4)
    dark, plain = cloud(bumpy, texture=True)["intensity"], cloud(bumpy, relief=True)["intensity"]
    assert np.allclose(dark, 0.8 * plain)


def test_glossy_paint_returns_little_at_a_slant() -> None:
    # tan^2 30 / (2 x 0.2094^2) = 3.80: exp(-3.80) = 0.0224 of the lobe is left.
    cos = float(np.cos(np.deg2rad(30)))
    assert gloss_lobe(np.array([1.0, cos], np.float32)) == pytest.approx([1.0, 0.0224], abs=2e-4)
    paint = surface(10, cos, 0.5, gloss=0.9)
    share = cloud(paint, gloss=True)["intensity"] / cloud(paint)["intensity"]
    assert share == pytest.approx(0.1 + 0.9 * 0.0224, rel=0.01)


def test_wet_ground_is_dark_and_darker_at_a_slant() -> None:
    # Normal: (1 - 0.0201)^2 / 1.33^2 = 0.543. At 80 degrees Schlick gives 0.0201 + 0.9799 x 0.8264^5 = 0.398.
    assert wet_share(np.array([1.0, 0.17365], np.float32)) == pytest.approx([0.543, 0.205], abs=2e-3)
    rain = Weather(kind="rain", rate_mm_per_h=10)
    road, wall = surface(40, 0.2, 0.14), surface(40, 0.2, 0.14, surface="building")
    assert len(cloud(road, rain)) < 0.8 * len(cloud(wall, rain))
    # A drizzle of 0.01 mm/h wets a hundredth.
    drizzle = cloud(surface(10, 1, 0.14), Weather(kind="rain", rate_mm_per_h=0.01))
    assert np.median(drizzle["intensity"]) == pytest.approx(0.14 * (1 - 0.01 * 0.457), rel=2e-3)


def test_rings_have_fixed_errors_of_their_own(facing: Callable[..., Hits]) -> None:
    sensor = LidarSensor(
        channels=200, points_per_second=20_000, **QUIET,
        imperfections=IDEAL.model_copy(
            update={"ring_range_stddev_m": 0.02, "ring_elevation_stddev_deg": 0.1}
        ),
    )  # fmt: skip
    clouds = [
        Lidar(sensor, calibration=np.random.default_rng(7)).measure(
            facing(2000, 20, "plaster"), np.random.default_rng(seed)
        )
        for seed in (0, 1)
    ]
    errors = ranges_m(clouds[0])[:200] - 20
    assert errors.std() == pytest.approx(0.02, rel=0.15)
    assert np.allclose(ranges_m(clouds[0]).reshape(-1, 200) - 20, errors, atol=1e-5)  # in every column
    assert np.array_equal(clouds[0]["x"], clouds[1]["x"])  # and in every turn
    perfect, real = Lidar(sensor), Lidar(sensor, calibration=np.random.default_rng(7))
    elevations = [np.rad2deg(np.arcsin(lidar.rays(np.eye(4))[:200, 5])) for lidar in (perfect, real)]
    assert (elevations[1] - elevations[0]).std() == pytest.approx(0.1, rel=0.15)


def test_an_ideal_sensor_is_reached_by_its_keys() -> None:
    assert Imperfections.model_validate(dict.fromkeys(IDEAL.model_dump(), 0.0) | {
        name: False for name, value in IDEAL.model_dump().items() if isinstance(value, bool)
    }) == IDEAL  # fmt: skip
    assert all(Imperfections().model_dump().values())
