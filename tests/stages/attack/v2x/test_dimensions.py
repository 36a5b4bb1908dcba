from __future__ import annotations

from one_attacker import genuine


def test_larger_and_smaller(attacked_cams):
    """4.5 + 4 by 1.8 + 1; never smaller than 0.1 m; no wider than the 6 m that a CAM can tell."""
    (reported,) = attacked_cams("cam-dimensions", [genuine(0)])
    assert (reported.length_m, reported.width_m) == (8.5, 2.8)
    (reported,) = attacked_cams("cam-dimensions", [genuine(0)], length_m=-10.0, width_m=6.0)
    assert (reported.length_m, reported.width_m) == (0.1, 6.0)
    (reported,) = attacked_cams("cam-dimensions", [genuine(0, length_m=None)])
    assert reported.length_m is None
