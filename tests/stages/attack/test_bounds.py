"""Parameters outside of what an attack takes."""

from __future__ import annotations

import math

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.bounds import checked_choice, checked_integer, checked_number, checked_range


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.1, True, "3", None])
def test_no_number_from_zero_up(value):
    with pytest.raises(AdvpipeError, match=r"cam-x: gap_m is .*; it takes a number, at least 0"):
        checked_number("cam-x", "gap_m", value, 0)


def test_what_is_taken():
    assert checked_number("cam-x", "gap_m", 0, 0) == 0
    assert checked_number("cam-x", "share", 1.0, 0, 1) == 1
    assert checked_integer("cam-x", "ghosts", 3.0, 1, 5) == 3
    assert checked_range("cam-x", "age_{}_s", 1, 2, 0, 5) == (1, 2)
    assert checked_choice("cam-x", "around", "victim", ("attacker", "victim")) == "victim"


def test_halves_reversed_ends_and_unknown_words():
    with pytest.raises(AdvpipeError, match="whole number"):
        checked_integer("cam-x", "ghosts", 2.5, 1, 5)
    with pytest.raises(AdvpipeError, match="cam-x: age_min_s, 3, is above age_max_s, 2"):
        checked_range("cam-x", "age_{}_s", 3, 2, 0, 5)
    with pytest.raises(AdvpipeError, match="known: attacker, victim"):
        checked_choice("gnss-x", "around", "nobody", ("attacker", "victim"))
