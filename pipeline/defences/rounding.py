"""Defences that perturb the positions of points by quantisation or by noise."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.defences.base import DefendedCloud, with_xyz
from advpipe.pipeline.messages.cloud import Cloud, xyz


class Quantisation:
    """Rounds coordinates to multiples of `step_m`."""

    is_default: ClassVar[bool] = True

    def __init__(self, *, step_m: float = 0.01) -> None:
        self.step_m = positive("quantise", "step_m", step_m)

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        points = xyz(cloud).astype(np.float64)
        return DefendedCloud(with_xyz(cloud, np.round(points / self.step_m) * self.step_m))


class Jitter:
    """Adds Gaussian noise of standard deviation `sigma_m` to every coordinate."""

    is_default: ClassVar[bool] = True

    def __init__(self, *, sigma_m: float = 0.01) -> None:
        self.sigma_m = positive("jitter", "sigma_m", sigma_m)

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        return DefendedCloud(with_xyz(cloud, xyz(cloud) + rng.normal(0, self.sigma_m, (len(cloud), 3))))


def positive(defence: str, name: str, value: float) -> float:
    """Check that a parameter's value is finite and above 0, and return it. Raises UsageError otherwise."""
    if not 0 < value < math.inf:
        raise UsageError(f"defence {defence}: {name} is {value:g}, but must be finite and above 0")
    return value
