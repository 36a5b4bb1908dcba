"""The best of many candidates, kept for each object by what the detector actually finds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]


class PerObjectBest:
    """Evaluates candidates for one cloud and keeps the most successful points of each object.

    An object that a candidate succeeds on is done: the focus closes it, and later candidates are evaluated
    around the others alone. The combination of the best points is not evaluated again.

    clean: points (N, 4) x, y, z, intensity, in which the detector found `found`. owner: (N,) the object that
    each point belongs to, -1 for none.
    """

    def __init__(
        self,
        goal: AttackGoal,
        detector: ObjectDetector,
        clean: Float32,
        found: Detections,
        owner: Int64,
        focus: Focus,
    ) -> None:
        self._goal, self._detector, self._owner, self._focus = goal, detector, owner, focus
        self._best, self._success = clean.copy(), goal.success(found)  # of each object
        done = goal.is_done(self._success)
        if not done.all():  # else nothing is found: follow the gradient everywhere
            focus.close(done)

    def update(self, candidate: Float32, found: Detections | None = None) -> Bool:
        """Evaluate a candidate (N, 4); returns the points (N,) for which it is the best so far.

        found: what the detector finds in the points that the focus shows, where that is known."""
        if not self._focus.is_open.any():
            return np.zeros(len(candidate), bool)
        if found is None:
            found = self._detector.detect(cloud_of_xyzi(candidate[self._focus.shown]))
        success = self._goal.success(found)
        better = self._focus.is_open & (success > self._success + 1e-9)
        self._success = np.where(better, success, self._success)
        taken: Bool = (self._owner >= 0) & np.append(better, False)[self._owner]
        self._best[taken] = candidate[taken]
        self._focus.close(better & self._goal.is_done(self._success))
        return taken

    def combined(self) -> Float32:
        """The best points (N, 4) of each object."""
        return self._best.copy()
