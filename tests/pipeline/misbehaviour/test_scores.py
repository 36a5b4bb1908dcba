"""Against scikit-learn, and by hand where it has no such figure."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sklearn.metrics import f1_score, matthews_corrcoef, precision_score, recall_score

from advpipe.pipeline.misbehaviour.scores import Scores, scores


@pytest.mark.oracle
def test_as_scikit_learn() -> None:
    rng = np.random.default_rng(1)
    truth, flagged = rng.random(500) < 0.3, rng.random(500) < 0.4
    found = scores(flagged, truth)
    assert found.precision == pytest.approx(precision_score(truth, flagged))
    assert found.recall == pytest.approx(recall_score(truth, flagged))
    assert found.f1 == pytest.approx(f1_score(truth, flagged))
    assert found.mcc == pytest.approx(matthews_corrcoef(truth, flagged))


def test_undefined_is_said() -> None:
    silent = Scores(0, 0, 5, 0)
    assert math.isnan(silent.precision)
    assert math.isnan(silent.recall)
    assert math.isnan(silent.f1)
    assert math.isnan(silent.mcc)
    assert silent.false_positive_rate == 0.0


def test_latency_of_those_who_are_caught() -> None:
    """Attacker 1 sends at 1, 2, 3 s and is detected at 3; attacker 2 sends at 5, undetected; 3 at once."""
    senders = np.array([1, 1, 1, 2, 3, 1])
    times_s = np.array([1.0, 2.0, 3.0, 5.0, 6.0, 0.5])
    truth = np.array([True, True, True, True, True, False])
    flagged = np.array([False, False, True, False, True, True])
    found = scores(flagged, truth, senders, times_s)
    assert found.latency_s == pytest.approx((2.0 + 0.0) / 2)
    assert found.caught == pytest.approx(2 / 3)
    assert (found.true_positives, found.false_positives) == (2, 1)


def test_innocent_stations_are_counted_apart() -> None:
    """Six honest messages, two of them an attacker's; three are flagged, one of an innocent station."""
    truth = np.array([True, False, False, False, False, False, False])
    flagged = np.array([True, True, True, True, False, False, False])
    attackers = np.array([True, True, True, False, False, False, False])
    found = scores(flagged, truth, np.arange(7), np.arange(7.0), attackers)
    assert (found.false_positives, found.innocent, found.innocent_flagged) == (3, 4, 1)
    assert found.false_positive_rate == pytest.approx(3 / 6)
    assert found.innocent_false_positive_rate == pytest.approx(1 / 4)
    assert scores(flagged, truth).innocent_false_positive_rate == pytest.approx(3 / 6)
