"""Bad weather: extinction by hand, echoes against a plain Monte Carlo, and what becomes of a cloud."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import quad

from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.sensors.lidar.atmosphere import (
    Fog,
    atmosphere_of,
    needed_signal,
    rain,
    snow,
    transmission,
)
from advpipe.pipeline.sensors.lidar.imperfections import IDEAL
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import Hits
from advpipe.stages.simulate.world.raycast.materials import MATERIALS
from advpipe.stages.simulate.world.raycast.mesh import box_mesh, merge, surface
from advpipe.stages.simulate.world.raycast.scene import Scene

MakeHits = Callable[..., Hits]

SENSOR = LidarSensor(points_per_second=64 * 3600, imperfections=IDEAL)
WORLD = Scene(
    merge(
        [
            surface([[-200, -200, 0], [200, -200, 0], [0, 300, 0]], [[0, 1, 2]], "asphalt"),
            *(
                box_mesh((4, 8, 12), "plaster").moved(x, y, 0)
                for x in (-60, -25, 15, 45)
                for y in (-30, -12, 12)
            ),
        ]
    )
)
HITS = WORLD.cast(Lidar(SENSOR).rays(np.eye(4)))


def weather(kind: str, strength: float) -> Weather:
    return Weather.model_validate(
        {"kind": kind, "visibility_m" if kind == "fog" else "rate_mm_per_h": strength}
    )


def cloud(of: Weather | None, seed: int = 0, sensor: LidarSensor = SENSOR, hits: Hits = HITS) -> Cloud:
    return Lidar(sensor, weather=of).measure(hits, np.random.default_rng(seed))


def true_range_m(points: Cloud, sensor: LidarSensor = SENSOR) -> np.ndarray:
    """How far the world is along the ray of each point."""
    bearing = np.arctan2(points["y"], points["x"])
    column = np.round((np.pi - bearing) / (2 * np.pi) * sensor.columns).astype(int) % sensor.columns
    return HITS.range_m.reshape(sensor.columns, -1)[column, points["ring"]]


def spurious(points: Cloud) -> np.ndarray:
    """Which points lie clearly before the world."""
    return np.linalg.norm(xyz(points), axis=1) < true_range_m(points) - 0.7


def test_extinction_equals_values_computed_by_hand() -> None:
    # Fog: ln 20 / 50. Rain of 10 mm/h: slope 4.1 x 10^-0.21 = 2.528; 8000 pi / 2.528^3 / 10^6.
    # Snow of 1 mm/h: 3800 pi / 2.55^3 / 10^6 = 0.00072, and 4.64 times the area.
    assert Fog(50, SENSOR).extinction_per_m == pytest.approx(0.059915, rel=1e-4)
    assert rain(10, SENSOR).extinction_per_m == pytest.approx(0.001556, rel=1e-3)
    assert snow(1, SENSOR).extinction_per_m == pytest.approx(0.000720 * 4.6416, rel=1e-3)


def test_transmission_at_the_visibility_is_that_of_its_definition() -> None:
    # One twentieth is left after the visibility, a four hundredth there and back.
    left = transmission(Fog(80, SENSOR), np.array([80, 40, 0], np.float32))
    assert np.allclose(left, [1 / 400, 1 / 20, 1], rtol=1e-5)


def test_extinction_of_rain_is_twice_the_area_of_its_drops() -> None:
    area_mm2, _ = quad(lambda d: np.pi / 4 * d**2 * 8000 * np.exp(-4.1 * 25**-0.21 * d), 0, 60)
    assert rain(25, SENSOR).extinction_per_m == pytest.approx(2 * area_mm2 * 1e-6, rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "rate", "density", "slope_per_mm", "reflectivity"),
    [("snow", 1.0, 3800, 2.55, 0.9), ("rain", 80.0, 8000, 4.1 * 80**-0.21, 0.02)],
)
def test_echoes_are_distributed_as_if_every_particle_were_drawn(
    kind: str, rate: float, density: float, slope_per_mm: float, reflectivity: float
) -> None:
    """LISA as published: all particles in the cone of each beam, of which the strongest counts."""
    sensor, rng, rays = SENSOR.model_copy(update={"range": 20.0}), np.random.default_rng(1), 100_000
    air = atmosphere_of(weather(kind, rate), sensor)
    assert air is not None
    cone_m3 = np.pi / 3 * 20.0 * (0.0015 * 20.0) ** 2
    count = rng.poisson(rays * density / slope_per_mm * cone_m3)
    ray, far_m = rng.integers(0, rays, count), 20.0 * rng.random(count) ** (1 / 3)
    filled = np.minimum(rng.exponential(1 / slope_per_mm, count) / (3 * far_m), 1) ** 2
    answer = reflectivity * filled * np.exp(-2 * air.extinction_per_m * far_m)
    noticed = (answer >= needed_signal(sensor, far_m)) & (far_m > 0.9)
    power = np.where(noticed, answer / far_m**2, 0)
    strongest = np.zeros(rays)
    np.maximum.at(strongest, ray, power)
    plain = far_m[noticed & (power == strongest[ray])]
    echoes = air.echoes(rays, np.random.default_rng(2))
    ours = echoes.range_m
    assert len(np.unique(echoes.rays)) == len(echoes.rays)
    assert len(plain) > 150
    assert len(ours) == pytest.approx(len(plain), abs=4 * np.sqrt(2 * len(plain)))
    assert ours.mean() == pytest.approx(plain.mean(), abs=4 * np.sqrt(2) * plain.std() / np.sqrt(len(plain)))
    power = echoes.signal / echoes.range_m**2
    assert np.median(power) == pytest.approx(np.median(strongest[strongest > 0]), rel=0.25)


def test_rain_of_10_mm_per_hour_is_seen_near_the_sensor() -> None:
    # 2.528 drops a mm of slope: at 1.5 m a beam of 4.5 mm needs 0.001 = 0.02 (D / 4.5)^2, so D of 1.0 mm.
    echoes = rain(10, SENSOR).echoes(100_000, np.random.default_rng(0))
    assert 0.005 < len(echoes.rays) / 100_000 < 0.01
    assert 1.2 < np.median(echoes.range_m) < 2.5
    assert echoes.signal.min() > 0.001 * 0.99


def test_clear_weather_changes_no_byte() -> None:
    assert cloud(Weather()).tobytes() == cloud(None).tobytes()


@pytest.mark.parametrize(("kind", "strength"), [("rain", 0.01), ("snow", 0.0005), ("fog", 1000.0)])
def test_faint_weather_is_nearly_clear(kind: str, strength: float) -> None:
    clear, faint = cloud(None), cloud(weather(kind, strength))
    assert len(faint) == pytest.approx(len(clear), rel=0.02)
    assert np.median(faint["intensity"]) == pytest.approx(np.median(clear["intensity"]), rel=0.15)


def test_the_same_seed_gives_the_same_bytes() -> None:
    for of in (weather("rain", 30), weather("snow", 2), weather("fog", 60)):
        assert cloud(of, 3).tobytes() == cloud(of, 3).tobytes()
        assert cloud(of, 3).tobytes() != cloud(of, 4).tobytes()


@pytest.mark.parametrize(
    ("kind", "strengths"),
    [("rain", (1, 10, 40, 150)), ("snow", (0.2, 1, 3, 10)), ("fog", (600, 200, 80, 30))],
)
def test_worse_weather_loses_more_points(kind: str, strengths: tuple[float, ...]) -> None:
    clouds = [cloud(weather(kind, strength)) for strength in strengths]
    real = [int((~spurious(c)).sum()) for c in clouds]
    false = [spurious(c).mean() for c in clouds]
    assert real == sorted(real, reverse=True)
    assert real[-1] < 0.97 * real[0]
    assert false == sorted(false)
    assert false[-1] > 0.002
    brightness = [np.median(c["intensity"][~spurious(c)]) for c in clouds]
    assert brightness == sorted(brightness, reverse=True)


@pytest.mark.parametrize(("kind", "strength"), [("rain", 100), ("snow", 3), ("fog", 40)])
def test_spurious_points_are_near_weak_and_before_the_surface(kind: str, strength: float) -> None:
    points = cloud(weather(kind, strength))
    false = spurious(points)
    range_m = np.linalg.norm(xyz(points), axis=1)
    assert false.sum() > 30
    assert (range_m[false] >= 0.9).all()
    assert np.quantile(range_m[false], 0.9) < 15
    assert np.median(points["intensity"][false]) < 0.3 * np.median(points["intensity"][~false])
    assert np.isfinite(xyz(points)).all()
    assert points["intensity"].min() >= 0
    assert points["intensity"].max() <= 1


def test_nothing_echoes_behind_a_wall(facing: MakeHits) -> None:
    wall = facing(SENSOR.columns * 64, 1.5, "rubber", 0.0)
    points = cloud(weather("snow", 10), hits=wall)
    assert np.linalg.norm(xyz(points), axis=1).max() < 1.7


def test_a_wall_in_fog_equals_values_computed_by_hand(facing: MakeHits) -> None:
    # Plaster at 24 m and a visibility of 50 m: 0.6 exp(-2 x 0.059915 x 24) = 0.03380 arrives. A white target
    # at 100 m is just seen, so 0.9 (24/100)^2 = 0.05184 is needed: 0.652 of it, seen 1 - 0.1^0.4252 often.
    quiet = {
        "noise_stddev": 0.0,
        "dropoff_general_rate": 0.0,
        "dropoff_intensity_limit": 0.0,
        "imperfections": IDEAL,
    }
    sensor = LidarSensor(
        channels=1,
        upper_fov=1,
        lower_fov=0,
        points_per_second=400_000,
        atmosphere_attenuation_rate=0,
        **quiet,
    )
    points = cloud(weather("fog", 50), sensor=sensor, hits=facing(40_000, 24, "plaster"))
    range_m = np.linalg.norm(xyz(points), axis=1)
    wall = range_m > 20
    assert wall.mean() * len(points) / 40_000 == pytest.approx((1 - 0.1**0.4252) * 0.9, abs=0.03)
    assert np.allclose(
        points["intensity"][wall], MATERIALS["plaster"] * np.exp(-2 * 0.0599146 * 24), rtol=1e-3
    )
    # LISA's range error: 0.09^2 / 2 of the variance for a signal as strong as needed. In clear air the margin
    # is 0.6 / 0.05184 = 11.57, and the fog leaves 0.05634 of it.
    stddev_m = 0.09 / np.sqrt(2) * np.sqrt((1 / 0.05634 - 1) / 11.574)
    assert np.std(range_m[wall]) == pytest.approx(stddev_m, rel=0.03)


def test_signs_are_detected_farther_in_fog_than_walls(facing: MakeHits) -> None:
    sensor = SENSOR.model_copy(update={"noise_stddev": 0.0})
    count = SENSOR.columns * 64
    seen = {
        material: (np.linalg.norm(xyz(cloud(weather("fog", 50), 0, sensor, hits)), axis=1) > 40).sum() / count
        for material in ("plaster", "sign")
        for hits in [facing(count, 50, material)]
    }
    assert seen["plaster"] < 0.01
    assert seen["sign"] > 0.3


@pytest.mark.parametrize(("kind", "strength"), [("rain", 200), ("snow", 200), ("fog", 5)])
@pytest.mark.filterwarnings("error")
def test_the_worst_weather_gives_finite_clouds(kind: str, strength: float) -> None:
    far = SENSOR.model_copy(update={"range": 500.0})
    points = cloud(weather(kind, strength), 0, far)
    assert np.isfinite(xyz(points)).all()
    assert np.isfinite(points["intensity"]).all()


BAD_WEATHER = {
    "rain without a rate": ({"kind": "rain"}, "rain needs its rate_mm_per_h"),
    "fog without a distance": ({"kind": "fog"}, "fog needs its visibility_m, of at most 1000"),
    "a rate of nothing": ({"rate_mm_per_h": 3}, "kind is clear; make it rain or snow"),
    "a rate of fog": ({"kind": "fog", "visibility_m": 90, "rate_mm_per_h": 3}, "kind is fog; make it rain"),
    "a distance in rain": ({"kind": "rain", "rate_mm_per_h": 3, "visibility_m": 90}, "is rain; make it fog"),
    "negative": ({"kind": "snow", "rate_mm_per_h": -1}, "greater than or equal to 0"),
    "no air": ({"kind": "fog", "visibility_m": 0.1}, "greater than or equal to 5"),
}


@pytest.mark.parametrize(("keys", "message"), BAD_WEATHER.values(), ids=BAD_WEATHER)
def test_invalid_weather_is_refused(keys: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Weather.model_validate(keys)


def test_clear_weather_has_no_atmosphere() -> None:
    assert atmosphere_of(Weather(), SENSOR) is None
