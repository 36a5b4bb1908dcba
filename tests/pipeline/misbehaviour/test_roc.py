"""The ROC curve against scikit-learn, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.roc import MOST_POINTS, roc_curve


def test_by_hand() -> None:
    """Of four pairs of a false and an honest message, three in order: and a tie counts half."""
    found = roc_curve(np.array([0.9, 0.4, 0.6, 0.1]), np.array([True, True, False, False]))
    assert found.auc == 0.75
    assert found.false_positive_rates == (0.0, 0.0, 0.5, 0.5, 1.0)
    assert found.recalls == (0.0, 0.5, 0.5, 1.0, 1.0)
    tied = roc_curve(np.array([0.5, 0.5]), np.array([True, False]))
    assert (tied.auc, tied.recalls) == (0.5, (0.0, 1.0))


def test_as_scikit_learn() -> None:
    metrics = pytest.importorskip("sklearn.metrics")
    rng = np.random.default_rng(1)
    is_false = rng.random(2000) < 0.2
    scores = np.round(rng.normal(is_false.astype(float), 1.0), 1)  # many ties
    found = roc_curve(scores, is_false)
    flagged, recalls, _ = metrics.roc_curve(is_false, scores, drop_intermediate=False)
    np.testing.assert_allclose(found.false_positive_rates, flagged)
    np.testing.assert_allclose(found.recalls, recalls)
    assert found.auc == pytest.approx(metrics.roc_auc_score(is_false, scores))


def test_thinned_it_keeps_its_ends_its_area_and_its_shape() -> None:
    rng = np.random.default_rng(2)
    is_false = rng.random(5000) < 0.3
    whole = roc_curve(rng.normal(2.0 * is_false, 1.0), is_false)
    thin = whole.thinned()
    assert len(thin.recalls) <= MOST_POINTS < len(whole.recalls)
    assert (thin.recalls[0], thin.recalls[-1], thin.auc) == (0.0, 1.0, whole.auc)
    steps = np.diff(thin.false_positive_rates)
    recalls = np.array(thin.recalls)
    assert (steps * (recalls[1:] + recalls[:-1]) / 2).sum() == pytest.approx(whole.auc, abs=0.002)


@pytest.mark.parametrize("is_false", [True, False])
def test_undefined_where_all_are_alike(is_false: bool) -> None:
    found = roc_curve(np.array([1.0, 2.0]), np.full(2, is_false))
    assert math.isnan(found.auc)
    assert found.recalls == ()
