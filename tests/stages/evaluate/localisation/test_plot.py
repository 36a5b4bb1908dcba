from __future__ import annotations

import numpy as np

from advpipe.stages.evaluate.localisation.plot import spans


def test_runs_of_attacked_steps():
    assert list(spans(np.array([0, 1, 1, 0, 0, 1, 0], dtype=bool))) == [(1, 2), (5, 5)]


def test_steps_between_two_fixes_do_not_part_them():
    """A fix in every other step."""
    attacked = np.zeros(20, dtype=bool)
    attacked[[2, 4, 6, 8, 14, 16, 18]] = True
    assert list(spans(attacked)) == [(2, 8), (14, 18)]


def test_none():
    assert list(spans(np.zeros(5, dtype=bool))) == []
