"""What a probe learns on other drives."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.attack_detection.threshold import area_under_roc
from advpipe.pipeline.audit.probe_model import MIN_UNITS, ProbeModel, untrained


def test_values_in_the_middle_are_learnt() -> None:
    """Attacked: 0.4 to 0.6; clean: 0 to 1. Untrained, the larger value alone says nothing."""
    draw = np.random.default_rng(3)
    other, own = ((draw.uniform(0.4, 0.6, 500), draw.uniform(0, 1, 500)) for _ in range(2))
    model = ProbeModel.learnt(np.concatenate(other), np.repeat([True, False], 500))
    assert model is not None
    attacked, clean = own
    assert abs(area_under_roc(untrained(clean), untrained(attacked)) - 0.5) < 0.05
    assert area_under_roc(model(clean), model(attacked)) > 0.87  # the best is 0.9


def test_values_that_are_not_there_count_as_a_value() -> None:
    values = np.array([np.nan] * 20 + [1.0] * 20)
    model = ProbeModel.learnt(values, np.arange(40) < 20)
    assert model is not None
    assert model(np.array([np.nan]))[0] > 3 > model(np.array([1.0]))[0]
    assert untrained(np.array([np.nan]))[0] == -np.inf


def test_few_units_teach_nothing() -> None:
    is_attacked = np.arange(100) < MIN_UNITS - 1
    assert ProbeModel.learnt(np.arange(100.0), is_attacked) is None


def test_values_beyond_those_learnt() -> None:
    model = ProbeModel.learnt(np.arange(100.0), np.arange(100) >= 50)
    assert model is not None
    assert model(np.array([1e9]))[0] > 1 > -1 > model(np.array([-1e9]))[0]
