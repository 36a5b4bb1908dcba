from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.gnss.relocate import Relocate

PATH = [[0, 0, 1], [10, 0, 1], [20, 0, 2]]


def test_an_offset_moves_along(follow):
    away = np.array(follow(Relocate(least_m=80, most_m=80), PATH)) - PATH
    assert np.allclose(away, away[0])
    assert np.hypot(away[0, 0], away[0, 1]) == pytest.approx(80)
    assert away[0, 2] == 0


def test_a_place_stays_where_it_was_at_the_begin(follow):
    spoofed = np.array(follow(Relocate(mode="place", least_m=80, most_m=80), PATH, first=1))
    assert np.array_equal(spoofed[0], spoofed[1])
    assert np.hypot(*(spoofed[0] - PATH[1])[:2]) == pytest.approx(80)
    assert spoofed[1, 2] == 1


def test_distances_are_uniform(follow):
    away = [
        np.linalg.norm(follow(Relocate(least_m=50, most_m=150), PATH, seed=s)[0] - PATH[0])
        for s in range(500)
    ]
    assert 50 <= min(away) < 52
    assert 148 < max(away) <= 150
    assert np.mean(away) == pytest.approx(100, abs=4)


def test_refuses_what_is_no_relocation():
    with pytest.raises(AdvpipeError, match="least_m is 1; it takes a number, 10"):
        Relocate(least_m=1)
    with pytest.raises(AdvpipeError, match="least_m 50 is above most_m 20"):
        Relocate(most_m=20)
    with pytest.raises(AdvpipeError, match="mode is 'teleport'; known: offset, place"):
        Relocate(mode="teleport")
