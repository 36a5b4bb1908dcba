"""Labels of neighbouring objects stand apart."""

from __future__ import annotations

import numpy as np

from advpipe.stages.evaluate.report.label_places import place_labels

PANEL = (300.0, 200.0)
SIZE = np.array([60.0, 10.0])


def rectangles(centres: np.ndarray) -> np.ndarray:
    return np.hstack([centres - SIZE / 2, centres + SIZE / 2])


def shared(one: np.ndarray, other: np.ndarray) -> float:
    sides = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
    return float(np.prod(np.clip(sides, 0, None)))


def test_a_lone_label_stands_below_its_object() -> None:
    own = np.array([[140.0, 90.0, 160.0, 110.0]])
    (centre,) = place_labels(own, SIZE[None], own, PANEL)
    np.testing.assert_allclose(centre, (150.0, 90.0 - 2.0 - 5.0))


def test_labels_of_a_row_of_neighbours_share_no_place() -> None:
    """Eight objects 20 apart, whose labels are 60 wide."""
    left = 60.0 + 20.0 * np.arange(8)
    own = np.column_stack([left, np.full(8, 95.0), left + 12, np.full(8, 105.0)])
    found = rectangles(place_labels(own, np.tile(SIZE, (8, 1)), own, PANEL))
    assert max(shared(a, b) for n, a in enumerate(found) for b in found[:n]) == 0.0
    assert (found[:, :2] >= 0).all()
    assert (found[:, 2:] <= PANEL).all()


def test_a_label_in_a_corner_stays_in_the_panel() -> None:
    own = np.array([[285.0, 0.0, 298.0, 12.0]])
    (found,) = rectangles(place_labels(own, SIZE[None], own, PANEL))
    assert found[1] >= 0
    assert found[2] <= PANEL[0]
    assert shared(found, own[0]) == 0.0


def test_no_object_needs_no_label() -> None:
    assert place_labels(np.zeros((0, 4)), np.zeros((0, 2)), np.zeros((0, 4)), PANEL).shape == (0, 2)
