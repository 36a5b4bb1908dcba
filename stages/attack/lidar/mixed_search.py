"""A search for detectors that show their detections alone, with a surrogate that proposes crossings.

Each candidate is a trial for every object: where the crossings that the surrogate asks for take its points
(`crossing_search`), or a deformation (`score_search`). Which of the two improves objects more often is tried
more often, so that a surrogate that is of no use costs little.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.adaptive_choice import AdaptiveChoice
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.stages.attack.lidar.crossing_search import CrossingSearch
from advpipe.stages.attack.lidar.score_search import ScoreSearch
from advpipe.stages.attack.lidar.search import Candidate

Bool = npt.NDArray[np.bool_]
Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

CROSSINGS = 1
"""Of the two options; 0 is a deformation."""


class MixedSearch:
    """The search on one cloud; a `Search`. owner: (N,) the object that each point belongs to, -1 for none."""

    def __init__(
        self, crossings: CrossingSearch, scores: ScoreSearch, owner: Int64, rng: np.random.Generator
    ) -> None:
        self.crossings, self.scores, self.owner = crossings, scores, owner
        self.is_open = crossings.focus.is_open
        self.choice = AdaptiveChoice(2, rng)
        self.drawn = np.zeros(len(self.is_open), np.int64)

    def candidates(self, steps: int) -> Iterator[Candidate]:
        """`steps` candidates, with a pass of the surrogate for each."""
        proposed = self.crossings.candidates(steps)
        next(proposed, None)  # the clean points, with their gradient
        for deformed in self.scores.candidates(steps):
            crossed = self._next(proposed)
            self.is_open = self.crossings.focus.is_open.copy()
            self.drawn = np.array(
                [self.choice.draw(np.array([True, crossed is not None])) for _ in self.is_open], np.int64
            )
            points = deformed.points
            if crossed is not None:
                points = np.where(self._of(CROSSINGS)[:, None], crossed.points, points)
            yield Candidate(points)

    def accept(self, better: Bool) -> None:
        """Continue from the points of the objects whose latest trial is the best so far, each by the search
        that it is of."""
        success = np.bincount(self.owner[better & (self.owner >= 0)], minlength=len(self.drawn)) > 0
        for number in np.flatnonzero(self.is_open).tolist():
            self.choice.learn(int(self.drawn[number]), is_success=bool(success[number]))
        self.crossings.accept(better & self._of(CROSSINGS))
        self.scores.accept(better & ~self._of(CROSSINGS))

    def _of(self, option: int) -> Bool:
        """The points (N,) of objects for which this option is drawn."""
        chosen: Bool = (self.owner >= 0) & np.append(self.drawn == option, False)[self.owner]
        return chosen

    @staticmethod
    def _next(proposed: Iterator[Candidate]) -> Candidate | None:
        """The next crossings; None once there are no more, or the surrogate has no gradient."""
        try:
            return next(proposed, None)
        except NoGradientError:
            return None
