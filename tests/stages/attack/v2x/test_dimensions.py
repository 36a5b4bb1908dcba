from __future__ import annotations

from one_attacker import honest


def test_larger_and_smaller(strike):
    """4.5 + 4 by 1.8 + 1; never smaller than 0.1 m; no wider than the 6 m that a CAM can tell."""
    (told,) = strike("cam-dimensions", [honest(0)])
    assert (told.length_m, told.width_m) == (8.5, 2.8)
    (told,) = strike("cam-dimensions", [honest(0)], length_m=-10.0, width_m=6.0)
    assert (told.length_m, told.width_m) == (0.1, 6.0)
    (told,) = strike("cam-dimensions", [honest(0, length_m=None)])
    assert told.length_m is None
