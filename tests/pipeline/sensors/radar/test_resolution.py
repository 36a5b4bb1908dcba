from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from advpipe.pipeline.sensors.radar.resolution import are_peaks, resolutions
from advpipe.pipeline.sensors.radar.section import RadarSensor


@pytest.mark.parametrize("preset", ["long-range", "imaging-4d"])
@pytest.mark.parametrize("count", [0, 1, 2, 400])
def test_peaks_are_those_that_a_tree_of_neighbours_finds(preset, count):
    section, rng = RadarSensor(preset=preset), np.random.default_rng(count)
    width = np.minimum(resolutions(section), 1.0)
    centre, power = rng.uniform(-4, 4, (count, 4)) * width, rng.exponential(1, count)
    near = cKDTree(centre / resolutions(section)).query_pairs(1 - 1e-9, p=np.inf) if count else set()
    expected = np.ones(count, bool)
    for a, b in near:
        expected[a if power[a] < power[b] else b] = False
    np.testing.assert_array_equal(are_peaks(section, centre, power), expected)
    if count == 400:
        assert 0 < expected.sum() < count
