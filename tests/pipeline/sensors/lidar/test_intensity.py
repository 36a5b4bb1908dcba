"""How strong surfaces answer, against numbers worked by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from advpipe.pipeline.sensors.lidar.imperfections import IDEAL
from advpipe.pipeline.sensors.lidar.intensity import GRAZING_SHARE, detected_share, noise_floor, return_signal
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.world import Hits
from advpipe.stages.simulate.world.raycast.materials import MATERIALS

MakeHits = Callable[..., Hits]

RAYS = 40_000
QUIET = {
    "noise_stddev": 0.0,
    "dropoff_general_rate": 0.0,
    "dropoff_intensity_limit": 0.0,
    "imperfections": IDEAL,
}
ONE_CHANNEL = {"channels": 1, "upper_fov": 1, "lower_fov": 0, "points_per_second": RAYS * 10}


def share_kept(sensor: LidarSensor, hits: Hits) -> float:
    return len(Lidar(sensor).measure(hits, np.random.default_rng(0))) / RAYS


def test_incidence_follows_oren_and_nayar(facing: MakeHits) -> None:
    # Their full formula for light and eye in the same place, worked out here with sigma = 20 degrees.
    variance, angle = np.deg2rad(20) ** 2, np.deg2rad(np.array([0, 30, 60, 85]))
    a, b = 1 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)
    expected = np.cos(angle) * (a + b * np.sin(angle) * np.tan(angle)) / a
    answers = [return_signal(facing(1, 10, "asphalt", np.cos(x)), np.array([0]), 0.0)[0] for x in angle]
    assert np.allclose(answers, MATERIALS["asphalt"] * expected, rtol=1e-5)
    assert pytest.approx(0.2992, abs=1e-4) == GRAZING_SHARE


def test_panes_and_air_attenuate(facing: MakeHits) -> None:
    answer = return_signal(facing(1, 50, "plaster", transmission=0.64), np.array([0]), 0.004)[0]
    assert answer == pytest.approx(MATERIALS["plaster"] * 0.64 * 0.8187308, rel=1e-5)  # exp(-0.2)


@pytest.mark.parametrize(("degrees", "expected"), [(0, 1.0), (39, 1.0), (41, None)])
def test_retroreflectors_return_fully_up_to_40_degrees(
    facing: MakeHits, degrees: float, expected: float | None
) -> None:
    cos = float(np.cos(np.deg2rad(degrees)))
    cloud = Lidar(LidarSensor(**QUIET, **ONE_CHANNEL)).measure(
        facing(RAYS, 60, "sign", cos), np.random.default_rng(0)
    )
    expected = expected or MATERIALS["sign"] * (cos + 0.2992 * (1 - cos**2)) * np.exp(-0.004 * 60)
    assert np.allclose(cloud["intensity"], expected, rtol=1e-3)


def test_weak_returns_are_lost_as_in_carla(facing: MakeHits) -> None:
    # Plaster at 50 m: 0.6 exp(-0.2) = 0.4912. Half of what is at zero times 1 - 0.4912/0.8, and a tenth more.
    sensor = LidarSensor(
        noise_stddev=0, dropoff_general_rate=0.1, dropoff_intensity_limit=0.8, dropoff_zero_intensity=0.5,
        imperfections=IDEAL, **ONE_CHANNEL,
    )  # fmt: skip
    expected = 0.9 * (1 - 0.5 * (1 - 0.4912 / 0.8))
    assert share_kept(sensor, facing(RAYS, 50, "plaster")) == pytest.approx(expected, abs=0.008)


def test_dark_surfaces_have_a_shorter_range(facing: MakeHits) -> None:
    sensor = LidarSensor(
        range=100, range_reflectivity=0.6, atmosphere_attenuation_rate=0, **QUIET, **ONE_CHANNEL
    )
    assert share_kept(sensor, facing(RAYS, 99.99, "plaster")) == pytest.approx(
        0.9, abs=0.006
    )  # its reflectivity is 0.6
    assert share_kept(sensor, facing(RAYS, 50, "plaster")) == 1.0
    # paint_black, 0.03: as far as 100 sqrt(0.05) = 22.4 m; at 44.7 m a fourth of what it takes.
    assert share_kept(sensor, facing(RAYS, 22.36, "paint_black")) == pytest.approx(0.9, abs=0.006)
    assert share_kept(sensor, facing(RAYS, 44.72, "paint_black")) == pytest.approx(
        1 - 0.1 ** (1 / 16), abs=0.008
    )
    assert share_kept(sensor, facing(RAYS, 99.99, "sign")) == 1.0
    everything = sensor.model_copy(update={"range_reflectivity": 0.0})
    assert share_kept(everything, facing(RAYS, 99.99, "paint_black", 0.01)) == 1.0


def test_the_noise_floor_equals_the_data_sheets_target() -> None:
    sensor = LidarSensor(preset="pandar64")
    floor = noise_floor(sensor, np.array([200.0, 100.0], np.float32))
    assert np.allclose(floor, [0.1, 0.025], rtol=1e-5)
    assert np.allclose(detected_share(np.array([0, 1, 2, 1e9], np.float32)), [0, 0.9, 0.9999, 1], atol=1e-6)
