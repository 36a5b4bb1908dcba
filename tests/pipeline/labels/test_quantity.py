"""What is within its bounds, and which of several attacks could have done it."""

from __future__ import annotations

import pytest

from advpipe.pipeline.labels.quantity import Quantity, beyond_all, excesses

DOUBLE = Quantity[float]("double", "m", "twice the number", lambda number: 2 * number)
COARSE = Quantity[float]("coarse", "1", "the number", lambda number: number, resolution=0.5)
POSITIVE = Quantity[float](
    "positive", "s", "the positive number", lambda number: number if number > 0 else None
)
QUANTITIES = {quantity.name: quantity for quantity in (DOUBLE, COARSE, POSITIVE)}


@pytest.mark.parametrize(
    ("number", "bounds", "said"),
    [
        (2.0, {"double": (0, 4)}, []),
        (2.1, {"double": (0, 4)}, ["twice the number: 4.2 m, but the attack declares 0 to 4 m (double)"]),
        (2.4, {"coarse": (2, 2)}, []),
        (2.6, {"coarse": (2, 2)}, ["the number: 2.6, but the attack declares 2 (coarse)"]),
        (-3.0, {"positive": (1, 2)}, []),
        (
            3.0,
            {"positive": (1, 2)},
            ["the positive number: 3 s, but the attack declares 1 to 2 s (positive)"],
        ),
        (
            float("nan"),
            {"double": (0, 4)},
            ["twice the number: nan m, but the attack declares 0 to 4 m (double)"],
        ),
    ],
)
def test_bounds(number: float, bounds: dict[str, tuple[float, float]], said: list[str]) -> None:
    """What cannot be measured is within any bounds; what is no number within none."""
    assert list(excesses(number, bounds, QUANTITIES)) == said


def test_any_of_several_may_have_done_it() -> None:
    assert beyond_all(3.0, [{"double": (0, 4)}, {"double": (0, 6)}], QUANTITIES) == ""
    assert beyond_all(3.0, [{"double": (0, 4)}, {}], QUANTITIES) == ""
    assert beyond_all(3.0, [{"double": (0, 4)}, {"double": (0, 5)}], QUANTITIES).endswith(
        "declares 0 to 4 m (double)"
    )
    assert beyond_all(3.0, [], QUANTITIES) == ""
