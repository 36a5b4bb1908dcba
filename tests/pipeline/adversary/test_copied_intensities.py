"""Intensities of added points, by numbers that a person can check."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.adversary.copied_intensities import copied_intensities


def test_they_lie_between_their_sources_and_the_next_one() -> None:
    clean = np.array([0.1, 0.5, 0.2, 0.3], np.float32)
    found = copied_intensities(clean, np.array([0, 2, 2, 1]))
    assert found == pytest.approx([0.15, 0.2 + 0.1 / 3, 0.2 + 0.2 / 3, 0.4])
    assert found.dtype == np.float32


def test_of_a_sensor_with_steps_they_are_copies() -> None:
    clean = np.repeat(np.array([0.1, 0.2], np.float32), 50)
    assert copied_intensities(clean, np.array([0, 99])).tolist() == clean[[0, 99]].tolist()
    assert copied_intensities(np.zeros(1, np.float32), np.array([0])).tolist() == [0.0]
