"""The text of a shape: SUMO names z at the points where it is not 0."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.stages.simulate.road_network.shape import length_m, parse_shape, shape_text

MIXED = "0.00,-1.60 50.00,-1.60,0.01 100.00,-1.60,2.50"


def test_points_with_and_without_z() -> None:
    assert parse_shape(MIXED).tolist() == [[0, -1.6, 0], [50, -1.6, 0.01], [100, -1.6, 2.5]]
    assert parse_shape("1,2 3,4").tolist() == [[1, 2, 0], [3, 4, 0]]
    assert parse_shape("  ").shape == (0, 3)


def test_shape_text_round_trips() -> None:
    for text in (MIXED, "0.00,1.60 100.00,1.60", "0.00,1.60,-3.00 100.00,1.60,4.00"):
        assert shape_text(parse_shape(text)) == text
    assert shape_text(np.array([[1.0, 2.0, 0.004]])) == "1.00,2.00"


@pytest.mark.parametrize("text", ["1", "1,2,3,4", "1,x", "1,,2", ","])
def test_an_invalid_shape_is_a_value_error(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_shape(text)


def test_length_of_a_polyline() -> None:
    assert length_m(parse_shape("0,0 3,4 3,4,12")) == 17
    assert length_m(parse_shape("")) == 0
