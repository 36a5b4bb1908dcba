"""Attacks of a defender's own on clean clouds."""

import numpy as np
import pytest

from advpipe.pipeline.attack_detection.rehearsal import evenly, spoofed_objects
from advpipe.pipeline.attack_detection.shadow_kind import ShadowKind, shadow_features

TO_THE_LEFT = np.array([0.0, 20.0, -1.0, 4.0, 2.0, 1.5, np.pi / 2])
"""A car 20 m to the left that points away from the sensor."""


def test_an_object_is_turned_to_straight_ahead():
    returns = np.array([[0.0, 18.5, -1.0]] * 300 + [[40, 0, -1.5]])
    (spoofed,) = spoofed_objects(returns, TO_THE_LEFT[None])
    assert spoofed.box == pytest.approx([5, 0, -1, 4, 2, 1.5, 0], abs=1e-12)
    assert len(spoofed.points) == 301 + 200
    assert spoofed.points[:301] == pytest.approx(returns)
    assert spoofed.points[301:] == pytest.approx(np.tile([3.5, 0, -1], (200, 1)))


def test_no_object_stands_in_another_or_has_hardly_a_return():
    ahead = np.array([6.0, 0.0, -1.0, 4.0, 2.0, 1.5, 0.0])
    returns = np.array([[0.0, 18.5, -1.0]] * 10)
    assert not list(spoofed_objects(returns, np.stack([TO_THE_LEFT, ahead])))
    assert not list(spoofed_objects(returns[:4], TO_THE_LEFT[None]))
    assert not list(spoofed_objects(returns, np.zeros((0, 7))))


def test_values_fill_the_cube():
    values = evenly(200, 3)
    counts, _ = np.histogramdd(values, bins=2, range=[(0, 1)] * 3)
    assert (counts >= 20).all()  # 25 on average
    assert (values == evenly(200, 3)).all()


def test_features_of_two_clusters():
    """Of 20 and 40 points, the second in a row of 0.19 m steps; one more lies apart. Twice as far, the same
    rays make the same clusters."""
    row = np.column_stack([np.full(40, 13.0), np.repeat(np.arange(4), 10) * 0.19, np.zeros(40)])
    points = np.concatenate([[[8.0, 0, 0]] * 20, row, [[17, 0, 0]]])
    assert np.expm1(shadow_features(points)) == pytest.approx([2, 30])
    assert (shadow_features(2 * points) == shadow_features(points)).all()
    assert np.expm1(shadow_features(points[:3])) == pytest.approx([0, 0])
    assert np.expm1(shadow_features(points[:0])) == pytest.approx([0, 0])


def test_the_discriminant_lies_half_way():
    """Of equal spreads, along the difference of the means: 1 and 5 clusters."""
    kind = ShadowKind.fitted(
        [np.array([5.0, 1.1]), np.array([5.0, 0.9])], [np.array([1.0, 1.1]), np.array([1.0, 0.9])]
    )
    assert kind.is_ghost(np.array([3.01, 1.0]))
    assert not kind.is_ghost(np.array([2.99, 1.0]))
    assert ShadowKind.fitted([], [np.zeros(2)]).is_ghost(np.zeros(2))
