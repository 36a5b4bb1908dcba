"""Footprints come back to the bit; texts that are none are refused with the key that is wrong."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shapely

from advpipe.pipeline.bag.footprints import footprints_of_text, footprints_text
from advpipe.pipeline.core.errors import AdvpipeError

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]


@pytest.mark.parametrize("count", [0, 1, 20])
def test_footprints_to_the_bit(count: int) -> None:
    rng = np.random.default_rng(1)
    footprints = [shapely.MultiPoint(rng.uniform(-500, 500, (4, 2))).convex_hull for _ in range(count)]
    found = footprints_of_text(footprints_text(footprints), "bag")
    assert len(found) == count
    for one, expected in zip(found, footprints, strict=True):
        assert (shapely.get_coordinates(one) == shapely.get_coordinates(expected)).all()


def test_a_court_in_a_building() -> None:
    court = [[0.2, 0.2], [0.4, 0.2], [0.4, 0.4], [0.2, 0.2]]
    (found,) = footprints_of_text(text_of([[SQUARE, court]]), "bag")
    assert found.area == pytest.approx(1 - 0.02)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "not valid JSON"),
        ("{}", "type: Field required"),
        ('{"type": "Point", "coordinates": [0, 0]}', "type: Input should be 'MultiPolygon'"),
        ('{"type": "MultiPolygon"}', "coordinates: Field required"),
        ('{"type": "MultiPolygon", "coordinates": ' + "[" * 200 + "]" * 200 + "}", "more than 100 levels"),
        ('{"type": "MultiPolygon", "coordinates": [[[[NaN, 0], [1, 0], [1, 1], [NaN, 0]]]]}', "NaN"),
    ],
    ids=lambda text: text[:40],
)
def test_texts_that_are_none(text: str, what: str) -> None:
    with pytest.raises(AdvpipeError, match=what) as caught:
        footprints_of_text(text, "bag: /v2x/buildings holds no footprints")
    assert str(caught.value).startswith("bag: /v2x/buildings holds no footprints")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("ring", "what"),
    [
        (SQUARE[:3], "at least 4 items"),
        (SQUARE[:4], "polygon 0 is not closed"),
        ([[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]], "Self-intersection"),
        ([[0, 0], [1e9, 0], [1, 1], [0, 0]], "less than or equal to 10000000"),
        ([[0, 0], [True, 0], [1, 1], [0, 0]], "valid number"),
        ([[0, 0], ["1", 0], [1, 1], [0, 0]], "valid number"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0]], "at most 2 items"),
        ([[0, 0]] * 10_001, "at most 10000 items"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_rings_that_are_none(ring: object, what: str) -> None:
    with pytest.raises(AdvpipeError, match=what):
        footprints_of_text(text_of([[ring]]), "bag")


def text_of(coordinates: object) -> str:
    return json.dumps({"type": "MultiPolygon", "coordinates": coordinates})
