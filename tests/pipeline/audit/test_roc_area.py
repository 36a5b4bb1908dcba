"""The area agrees with SciPy's rank test, and the interval with what repeated draws show."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from advpipe.pipeline.audit.roc_area import roc_area


@pytest.mark.oracle
def test_the_area_is_that_of_the_rank_test() -> None:
    draw = np.random.default_rng(1)
    scores = draw.integers(0, 6, 300).astype(float)  # with ties
    is_attacked = draw.random(300) < 0.3
    found = roc_area(scores, is_attacked, draw.integers(0, 9, 300))
    expected = mannwhitneyu(scores[is_attacked], scores[~is_attacked]).statistic
    assert found.area == pytest.approx(expected / (is_attacked.sum() * (~is_attacked).sum()))
    assert (found.attacked, found.clean, found.clusters) == (is_attacked.sum(), (~is_attacked).sum(), 9)


def test_the_interval_by_hand() -> None:
    """Three clusters, told apart: pseudo-values 1, 1, 1, with 0 and 1 added: mean 0.8, variance 0.2 / 5, and
    Student's t of 4 degrees is 2.776."""
    found = roc_area(np.tile([0.0, 1.0], 3), np.tile([False, True], 3), np.repeat(np.arange(3), 2))
    assert found.area == 1
    assert found.low == pytest.approx(0.8 - 2.776445 * 0.2, abs=1e-5)
    assert found.high == 1


@pytest.mark.parametrize("probes", [1, 20])
def test_units_of_a_moment_that_are_alike_do_not_make_a_finding(probes: int) -> None:
    """Twelve clusters, 20 units each; each cluster has a level of its own for attacked and for clean ones."""
    draw, covered, above = np.random.default_rng(2), 0, 0
    cluster = np.repeat(np.arange(12), 20)
    is_attacked = np.tile(np.arange(20) < 10, 12)
    for _ in range(150):
        level = draw.standard_normal((12, 2))
        scores = level[cluster, is_attacked.astype(int)] + 0.1 * draw.standard_normal(240)
        found = roc_area(scores, is_attacked, cluster, probes)
        covered += found.low <= 0.5 <= found.high
        above += found.low > 0.6
    assert covered >= 140
    assert above == 0


@pytest.mark.parametrize(("clusters", "is_certain"), [(4, False), (30, True)])
def test_a_perfect_probe_is_certain_only_with_many_clusters(clusters: int, is_certain: bool) -> None:
    cluster = np.repeat(np.arange(clusters), 2)
    is_attacked = np.arange(2 * clusters) % 2 == 1
    found = roc_area(is_attacked.astype(float), is_attacked, cluster, tests=50)
    assert found.area == 1
    assert (found.low > 0.6) == is_certain


def test_one_kind_alone_or_one_cluster_gives_no_interval() -> None:
    alone = roc_area(np.ones(3), np.ones(3, bool), np.arange(3))
    assert np.isnan([alone.area, alone.low, alone.high]).all()
    one = roc_area(np.array([0.0, 1.0]), np.array([False, True]), np.zeros(2, int))
    assert one.area == 1
    assert np.isnan([one.low, one.high]).all()


def test_attacked_units_of_two_moments_give_no_interval() -> None:
    cluster, is_attacked = np.arange(40), np.arange(40) < 2
    found = roc_area(is_attacked.astype(float), is_attacked, cluster)
    assert found.area == 1
    assert np.isnan([found.low, found.high]).all()


def test_reversed_scores() -> None:
    draw = np.random.default_rng(8)
    scores, is_attacked, cluster = draw.random(60), draw.random(60) < 0.5, draw.integers(0, 12, 60)
    found, other = (roc_area(sign * scores, is_attacked, cluster) for sign in (1, -1))
    assert [found.reversed.area, found.reversed.low, found.reversed.high] == pytest.approx(
        [other.area, other.low, other.high]
    )


def test_an_attack_on_one_cluster_alone_has_no_interval() -> None:
    """However many clean ones there are: its one moment may be special for any reason."""
    found = roc_area(np.arange(40.0), np.arange(40) == 39, np.arange(40))
    assert found.area == 1
    assert np.isnan([found.low, found.high]).all()
