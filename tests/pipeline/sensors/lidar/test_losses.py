"""Lost returns: their share is exact, and they come in patches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from advpipe.pipeline.sensors.lidar.imperfections import IDEAL
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.losses import Patches
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.world import Hits

COLUMNS, CHANNELS = 900, 32


def alike(uniform: np.ndarray) -> float:
    """Correlation of neighbouring columns."""
    image = uniform.reshape(COLUMNS, CHANNELS)
    return float(np.corrcoef(image[:-1].ravel(), image[1:].ravel())[0, 1])


def test_numbers_are_uniform_alike_in_patches_and_new_in_each_turn() -> None:
    patches, rng = Patches(COLUMNS, CHANNELS), np.random.default_rng(0)
    first, second = patches.uniform(rng), patches.uniform(rng)
    for uniform in (first, second):
        assert np.histogram(uniform, 10, (0, 1))[0] == pytest.approx(COLUMNS * CHANNELS / 10, abs=2)
        assert uniform.min() >= 0
        assert uniform.max() < 1
        assert alike(uniform) > 0.5
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.2
    assert np.array_equal(first, Patches(COLUMNS, CHANNELS).uniform(np.random.default_rng(0)))


def test_a_sensor_of_one_ray_has_a_number() -> None:
    assert Patches(1, 1).uniform(np.random.default_rng(0)).shape == (1,)


@pytest.mark.parametrize("patchy", [False, True])
def test_the_dropoff_keys_keep_their_meaning(facing: Callable[..., Hits], patchy: bool) -> None:
    sensor = LidarSensor(
        channels=CHANNELS, points_per_second=COLUMNS * CHANNELS * 10, noise_stddev=0,
        dropoff_general_rate=0.25, dropoff_intensity_limit=0,
        imperfections=IDEAL.model_copy(update={"patchy_losses": patchy}),
    )  # fmt: skip
    cloud = Lidar(sensor).measure(facing(COLUMNS * CHANNELS, 20, "plaster"), np.random.default_rng(0))
    assert len(cloud) == pytest.approx(0.75 * COLUMNS * CHANNELS, rel=0.01)
    column = np.round((np.pi - np.arctan2(cloud["y"], cloud["x"])) / (2 * np.pi) * COLUMNS).astype(int)
    lost = np.ones((COLUMNS, CHANNELS))
    lost[column % COLUMNS, cloud["ring"]] = 0
    assert (alike(lost.ravel()) > 0.3) == patchy


def test_the_default_sensor_loses_little_on_asphalt(facing: Callable[..., Hits]) -> None:
    # At 10 m and 80 degrees: 0.14 x (0.174 + 0.2992 x 0.97) x exp(-0.04) = 0.0624, above the limit of 0.05.
    sensor = LidarSensor(channels=CHANNELS, points_per_second=COLUMNS * CHANNELS * 10)
    cloud = Lidar(sensor).measure(facing(COLUMNS * CHANNELS, 10, "asphalt", 0.1736), np.random.default_rng(0))
    assert len(cloud) == pytest.approx(0.99 * COLUMNS * CHANNELS, rel=0.005)
