"""Mixed pixels and blooming, against geometry worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.sensors.lidar.edges import bloom, mix_edges
from advpipe.pipeline.sensors.lidar.imperfections import IDEAL, Imperfections
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.lidar.sweep import LidarSweep
from advpipe.pipeline.sensors.world import Hits

COLUMNS = 40_000


def fence(near_m: float, far_m: float) -> np.ndarray:
    """One ring that sees two columns of a near surface, then two of a far one, and so on."""
    return np.tile(np.array([near_m, near_m, far_m, far_m], np.float32), COLUMNS // 4)


def test_the_share_and_the_ranges_of_mixed_pixels_follow_from_the_beam() -> None:
    range_m = fence(10.0, 11.0)
    # A beam half as wide as the columns are apart: 1/4 of the edges on either side's beam, half of all.
    touched = mix_edges(range_m, 1, 0.003, 0.0015, np.random.default_rng(0))
    changed = np.flatnonzero(range_m != fence(10.0, 11.0))
    assert set(changed) <= set(touched)
    assert len(changed) / (COLUMNS / 2) == pytest.approx(0.5, abs=0.02)
    # The share on the other surface is uniform up to a half: nothing jumps over the middle.
    near = fence(0.0, 1.0)[changed] == 0
    assert range_m[changed][near].min() > 10
    assert range_m[changed][near].max() < 10.5
    assert range_m[changed][near].mean() == pytest.approx(10.25, abs=0.01)
    assert range_m[changed][~near].mean() == pytest.approx(10.75, abs=0.01)


@pytest.mark.parametrize("far_m", [10.1, 12.0, np.inf])
def test_only_echoes_that_overlap_mix(far_m: float) -> None:
    range_m = fence(10.0, far_m)
    assert not len(mix_edges(range_m, 1, 0.003, 0.003, np.random.default_rng(0)))
    assert np.array_equal(range_m, fence(10.0, far_m))


def test_a_cloud_has_points_between_two_walls_only_with_a_beam_of_some_width() -> None:
    for divergence_deg, least, most in ((0.0, 0, 0), (0.18, 100, 1000)):
        real = IDEAL.model_copy(update={"beam_divergence_deg": divergence_deg})
        sensor = LidarSensor(
            channels=1, upper_fov=1, lower_fov=0, points_per_second=18_000, noise_stddev=0,
            dropoff_general_rate=0, imperfections=real,
        )  # fmt: skip
        range_m = np.tile(np.array([10, 10, 10, 11, 11, 11], np.float32), 300)
        ones = np.ones(1800, np.float32)
        hits = Hits(
            range_m,
            ones,
            ones,
            np.zeros(1800, bool),
            ones,
            np.full(1800, -1, np.int32),
            np.zeros(0, np.float32),
        )
        cloud = Lidar(sensor).measure(hits, np.random.default_rng(0))
        found_m = np.linalg.norm(xyz(cloud), axis=1)
        assert least <= ((found_m > 10.01) & (found_m < 10.99)).sum() <= most
        assert len(cloud) == 1800


SWEEP = LidarSweep(LidarSensor(channels=5, upper_fov=1.0, lower_fov=-1.0, points_per_second=5 * 1800 * 10))


def test_light_of_a_retroreflector_falls_by_a_thousandth_over_the_angle() -> None:
    source = 100 * 5 + 2  # the middle ring, which looks level
    found = bloom(np.array([source]), np.array([200.0], np.float32), SWEEP, np.deg2rad(0.45))
    light = dict(zip(found.rays.tolist(), found.signal.tolist(), strict=True))
    # Columns are 0.2 degrees apart, rings 0.5: two columns either side, and no ring.
    assert set(light) == {source - 10, source - 5, source + 5, source + 10}
    assert light[source + 5] == pytest.approx(200 * 10 ** (-3 * 0.2 / 0.45), rel=0.01)
    assert light[source - 10] == pytest.approx(200 * 10 ** (-3 * 0.4 / 0.45), rel=0.01)
    assert set(found.sources.tolist()) == {source}


def test_blooming_stays_in_the_fan_and_takes_the_brighter_source() -> None:
    top = 4  # the first column, the highest ring: no ray before it, none above
    found = bloom(np.array([top, top + 10]), np.array([100.0, 200.0], np.float32), SWEEP, np.deg2rad(0.6))
    assert (found.rays >= 0).all()
    assert set(found.rays.tolist()) >= {top + 5, top + 4, top + 9}
    assert len(set(found.rays.tolist())) == len(found.rays)
    at = found.rays.tolist().index(top + 5)
    assert found.sources[at] == top + 10
    assert not len(bloom(np.zeros(0, np.int64), np.zeros(0, np.float32), SWEEP, 0.01).rays)


@pytest.mark.parametrize(("blooming_deg", "plate"), [(0.0, 3), (0.35, 7)])
def test_a_plate_seems_wider_than_it_is(blooming_deg: float, plate: int) -> None:
    """Three columns of 1800 hit a plate 20 m away before a grey wall at 25 m."""
    real = Imperfections.model_validate(IDEAL.model_dump() | {"blooming_deg": blooming_deg})
    sensor = LidarSensor(
        channels=1, upper_fov=1, lower_fov=0, points_per_second=21_600, noise_stddev=0,
        dropoff_general_rate=0, imperfections=real,
    )  # fmt: skip
    columns = np.arange(2160)
    is_plate = np.abs(columns - 500) <= 1
    ones = np.ones(2160, np.float32)
    hits = Hits(
        np.where(is_plate, 20, 25).astype(np.float32), ones, 0.2 * ones, is_plate, ones,
        np.where(is_plate, 0, -1).astype(np.int32), np.zeros(1, np.float32),
    )  # fmt: skip
    cloud = Lidar(sensor).measure(hits, np.random.default_rng(0))
    assert (np.linalg.norm(xyz(cloud), axis=1) < 21).sum() == plate
    assert len(cloud) == 2160
