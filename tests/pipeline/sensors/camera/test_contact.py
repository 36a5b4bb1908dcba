"""How much of the sky the ground faces beside a road user, by numbers worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.camera.contact import ContactShadows

CAR = np.array([[10.0, 0.0, 0.75, 4.0, 2.0, 1.5, 0.0]])
CAMERA_M = np.array([0.0, 0.0, 1.5])


def share(
    point_m: tuple[float, float, float], boxes: np.ndarray = CAR, camera_m: np.ndarray = CAMERA_M
) -> float:
    points = np.array([point_m, (500.0, 500.0, 0.0)], np.float32).T
    found = ContactShadows(boxes, camera_m).openness(np.ascontiguousarray(points), np.array([0, 1]))
    assert found[1] == 1  # far from all boxes
    return float(found[0])


def test_the_ground_is_darkest_below_a_car_and_lighter_beside_it() -> None:
    """1 - 0.82 exp(-d / 0.3 m), from an outline 0.1 m within the sides and 0.15 m within the ends on."""
    assert share((10.0, 0.0, 0.0)) == pytest.approx(0.18)
    assert share((10.0, 1.2, 0.0)) == pytest.approx(1 - 0.82 * np.exp(-0.3 / 0.3))
    assert share((12.45, 1.5, 0.0)) == pytest.approx(1 - 0.82 * np.exp(-np.hypot(0.6, 0.6) / 0.3), abs=1e-5)


def test_what_is_far_high_or_no_ground_is_not_darkened() -> None:
    assert share((10.0, 1.9, 0.0)) == 1  # 1 m from the outline
    assert share((10.0, 0.5, 0.7)) == 1  # above the road
    assert share((10.0, 0.0, 0.0), camera_m=np.array([50.0, 0.0, 1.5])) == 1  # the camera is far
    below = np.array([[10.0], [0.0], [0.0]], np.float32)
    assert ContactShadows(CAR, CAMERA_M).openness(below, np.zeros(0, np.int64)) == 1
    assert ContactShadows(CAR[:0], CAMERA_M).openness(below, np.array([0])) == 1


def test_it_turns_with_the_car_and_two_cars_darken_twice() -> None:
    across = CAR.copy()
    across[0, 6] = np.pi / 2
    assert share((10.0, 2.15, 0.0), across) == pytest.approx(1 - 0.82 * np.exp(-0.3 / 0.3), abs=1e-5)
    assert share((10.0, 0.0, 0.0), np.concatenate([CAR, CAR])) == pytest.approx(0.18**2)
