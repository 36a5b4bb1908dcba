from __future__ import annotations

import pytest
from one_attacker import honest

from advpipe.pipeline.errors import AdvpipeError


def test_each_attacker_draws_one(strike):
    """Either it is longer, or it heads the other way; never both, and both occur."""
    messages = [honest(0)]
    kinds = set()
    for seed in range(12):
        (told,) = strike("cam-mix", messages, seed=seed, attacks="cam-heading-reversed,cam-dimensions")
        kinds.add((told.length_m > 4.5, told.heading_rad > 4))
    assert kinds == {(True, False), (False, True)}


def test_no_attack(strike):
    with pytest.raises(AdvpipeError, match="'cam-mix' is no attack to mix"):
        strike("cam-mix", [honest(0)], attacks="cam-dimensions, cam-mix")
