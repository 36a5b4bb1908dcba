"""Numbers that attackers draw for their lies, each from a generator of its own."""

from __future__ import annotations

import numpy as np

from advpipe.stages.attack.v2x.base import AttackContext


class AttackDraws:
    """One generator for each attacker, under the attack's name."""

    def __init__(self, context: AttackContext) -> None:
        self._rngs = {number: context.rng("lie", number) for number in context.attackers}

    def of(self, station_id: int) -> np.random.Generator:
        """An attacker's own."""
        return self._rngs[station_id]

    def signed(self, station_id: int, least: float, most: float) -> float:
        """Uniform between both, with either sign: never the positive one alone."""
        rng = self._rngs[station_id]
        size = float(rng.uniform(least, most))
        return size if rng.random() < 0.5 else -size
