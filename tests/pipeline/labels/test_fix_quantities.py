"""Quantities of a false fix, worked out by hand."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.labels.fix_quantities import FIX_QUANTITIES, FixChange


def test_measures() -> None:
    """4 m west, 3 m north and 12 m down are 13 m."""
    change = FixChange(np.array([-4.0, 3.0, -12.0]))
    assert {name: quantity.measure(change) for name, quantity in FIX_QUANTITIES.items()} == {
        "fix_displacement_m": 13.0,
        "fix_height_change_m": 12.0,
    }
