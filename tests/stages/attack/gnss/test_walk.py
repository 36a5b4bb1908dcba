from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.gnss.walk import RandomWalk


def test_spreads_with_the_root_of_time(follow):
    """Each axis after 1 s: standard deviation 2 m; after 4 s: 4 m."""
    ends = np.array(
        [np.array(follow(RandomWalk(), [[0, 0, 7]] * 41, seed=s))[[0, 10, 40]] for s in range(400)]
    )
    assert np.array_equal(ends[:, 0], np.tile([0.0, 0, 7], (400, 1)))
    assert np.allclose(ends[:, 1, :2].std(axis=0), 2, rtol=0.15)
    assert np.allclose(ends[:, 2, :2].std(axis=0), 4, rtol=0.15)
    assert (ends[:, :, 2] == 7).all()


def test_stays_within_its_circle(follow):
    distances = np.linalg.norm(follow(RandomWalk(stddev_m=20, most_m=3), [[0, 0, 0]] * 100), axis=1)
    assert distances.max() == pytest.approx(3)
    assert (distances > 2.99).sum() > 20


def test_refuses():
    with pytest.raises(AdvpipeError, match="gnss-walk: stddev_m is nan"):
        RandomWalk(stddev_m=float("nan"))
