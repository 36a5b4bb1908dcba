"""A drive with turns, slopes and a stop, on which cars slide as the filter is told they do."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.localisation.geodesy import Geodesy

STEP_S = 0.1


def drive(seed: int, seconds: float) -> Float64:
    """True poses (K, 4, 4), one every 0.1 s."""
    rng = np.random.default_rng([17, seed])
    t = np.arange(round(seconds / STEP_S)) * STEP_S
    phase = rng.uniform(0, 2 * np.pi, 3)
    speed_mps = np.clip(9 + 9 * np.sin(2 * np.pi * t / 23 + phase[0]), 0, None)  # stands for a moment
    turn_radps = 0.35 * np.clip(np.sin(2 * np.pi * t / 13 + phase[1]), -0.7, 0.7) * (speed_mps > 0)
    yaw_rad = np.cumsum(turn_radps) * STEP_S + rng.uniform(-np.pi, np.pi)
    pitch_rad = 0.06 * np.sin(2 * np.pi * np.cumsum(speed_mps) * STEP_S / 150 + phase[2])
    memory = np.exp(-STEP_S / 0.5)
    slide, slides = rng.standard_normal(), []
    for _ in t:
        slide = memory * slide + np.sqrt(1 - memory**2) * rng.standard_normal()
        slides.append(slide)
    slide_mps = np.hypot(0.1, 1.5 * turn_radps) * np.array(slides) * (speed_mps > 0)
    place_m, poses = np.zeros(3), []
    for yaw, pitch, forward, sideways in zip(yaw_rad, pitch_rad, speed_mps, slide_mps, strict=True):
        rotation = se3_from_yaw(place_m, yaw, pitch)
        place_m = place_m + rotation[:3, :3] @ [forward, sideways, 0.0] * STEP_S
        poses.append(se3_from_yaw(place_m, yaw, pitch))
    return np.array(poses)


@pytest.fixture(scope="session")
def geodesy() -> Geodesy:
    return Geodesy(48.0, 11.0, 500.0)


@pytest.fixture(scope="session")
def make_drive() -> Callable[[int, float], Float64]:
    return drive
