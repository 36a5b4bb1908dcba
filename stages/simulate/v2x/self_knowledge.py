"""How well a station without instruments of ours knows itself: the truth, and an error that wanders."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.v2x import SelfKnowledge

POSITION_TIME_S = 30.0
HEADING_TIME_S = 10.0
SPEED_TIME_S = 5.0
"""Correlation times. White errors of ten times a second would look like dynamics, set off CAMs and make
nonsense of their path history; those of receivers wander."""


class Wander:
    """First-order Gauss-Markov errors of one station: east, north, heading, speed (4,)."""

    def __init__(self, knowledge: SelfKnowledge, step_s: float, rng: np.random.Generator) -> None:
        self._rng = rng
        times_s = np.array([POSITION_TIME_S, POSITION_TIME_S, HEADING_TIME_S, SPEED_TIME_S])
        heading_rad = np.deg2rad(knowledge.heading_stddev_deg)
        position_m = knowledge.position_stddev_m
        self._stddev = np.array([position_m, position_m, heading_rad, knowledge.speed_stddev_mps])
        self._memory = np.exp(-step_s / times_s)
        self._kick = np.sqrt(1 - self._memory**2) * self._stddev
        self.error: Float64 = self._stddev * rng.standard_normal(4)

    def step(self) -> Float64:
        """The errors (4,) one step later."""
        self.error = self._memory * self.error + self._kick * self._rng.standard_normal(4)
        return self.error
