"""Which kind of change a search tries next: the one that has improved objects more often, more often."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Bool = npt.NDArray[np.bool_]


class AdaptiveChoice:
    """Draws one of several options with a probability in proportion to the square of its share of successes.

    Adaptive operator selection by probability matching (Goldberg 1990, "Probability Matching, the Magnitude
    of Reinforcement, and Classifier System Bidding"); squared, as dozens of objects teach in a few trials.
    """

    def __init__(self, options: int, rng: np.random.Generator) -> None:
        self._successes, self._trials = np.ones(options), np.full(options, 2.0)
        self._rng = rng

    def draw(self, allowed: Bool) -> int:
        """One of the options (K,) that are allowed, at least one of which must be."""
        weight = np.where(allowed, np.square(self._successes / self._trials), 0.0)
        return int(self._rng.choice(len(weight), p=weight / weight.sum()))

    def learn(self, drawn: int, *, is_success: bool) -> None:
        """Count a trial of an option."""
        self._trials[drawn] += 1
        self._successes[drawn] += is_success
