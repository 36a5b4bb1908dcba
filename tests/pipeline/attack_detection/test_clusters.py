"""Clusters by density, beside scikit-learn's DBSCAN."""

import numpy as np
import pytest
from sklearn.cluster import DBSCAN

from advpipe.pipeline.attack_detection.clusters import density_clusters


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(5))
def test_as_scikit_learn_finds_them(seed):
    rng = np.random.default_rng(seed)
    middles = rng.uniform(0, 4, (6, 3))
    points = np.concatenate([middles[rng.integers(6, size=300)] + rng.normal(0, 0.12, (300, 3))])
    theirs = DBSCAN(eps=0.2, min_samples=15).fit(points)
    ours = density_clusters(points, 0.2, 15)
    assert ((ours < 0) == (theirs.labels_ < 0)).all()
    core = theirs.core_sample_indices_
    pairs = {(a, b) for a, b in zip(ours[core].tolist(), theirs.labels_[core].tolist(), strict=True)}
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs}) == theirs.labels_.max() + 1


def test_few_points_are_noise():
    line = np.column_stack([np.arange(5) * 0.1, np.zeros(5), np.zeros(5)])
    assert density_clusters(line, 0.15, 3).tolist() == [0] * 5  # the ends are in reach of a core
    assert density_clusters(line, 0.15, 4).tolist() == [-1] * 5
    assert density_clusters(np.zeros((0, 3)), 0.2, 15).shape == (0,)
