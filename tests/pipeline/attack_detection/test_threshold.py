"""Thresholds and areas against numbers worked out by hand, and against scipy's rank test."""

import math

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from advpipe.pipeline.attack_detection.threshold import area_under_roc, calibrated_threshold


def test_a_threshold_leaves_the_stated_share_above_it():
    scores = np.arange(1.0, 200.0)  # 199 of them
    assert calibrated_threshold(scores, 0.01) == 198  # ceil(200 * .99)
    assert calibrated_threshold(scores, 0.5) == 100


def test_too_few_scores_give_the_largest():
    assert calibrated_threshold(np.array([3.0, 1.0]), 0.01) == 3
    assert calibrated_threshold(np.zeros(0), 0.01) == math.inf


def test_further_clean_scores_exceed_it_at_most_at_the_stated_rate():
    rng = np.random.default_rng(0)
    drawn = [rng.normal(size=200) for _ in range(400)]
    above = [(rng.normal(size=200) > calibrated_threshold(each, 0.05)).mean() for each in drawn]
    assert np.mean(above) == pytest.approx(10 / 201, abs=0.005)  # ten of 201 ranks lie above


def test_area_of_a_hand_worked_example():
    assert area_under_roc(np.array([1.0, 2.0]), np.array([2.0, 3.0])) == (1 + 0.5 + 1 + 1) / 4
    assert math.isnan(area_under_roc(np.zeros(0), np.ones(2)))


@pytest.mark.oracle
def test_area_equals_the_rank_statistic_of_scipy():
    rng = np.random.default_rng(1)
    clean, attacked = rng.integers(0, 9, 50).astype(float), rng.integers(3, 12, 40).astype(float)
    expected = mannwhitneyu(attacked, clean).statistic / (len(clean) * len(attacked))
    assert area_under_roc(clean, attacked) == pytest.approx(expected)
