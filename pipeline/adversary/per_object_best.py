"""The best of many candidates, kept for each object by what the detector actually finds."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

COMBINED_AFTER = 0.75
"""The share of the tries after which the combination is judged at the latest."""

LEAST_TRIES = 4
"""With fewer tries all of them are candidates."""


class PerObjectBest:
    """Evaluates candidates for one cloud and keeps the most successful points of each object.

    An object that a candidate succeeds on is done: the focus closes it, and later candidates are evaluated
    around the others alone. One of the tries is the combination of the best points in the whole cloud, when
    all objects are done or a quarter of the tries is left: objects that are found there are opened again.

    clean: points (N, 4) x, y, z, intensity, in which the detector found `found`. owner: (N,) the object that
    each point belongs to, -1 for none. tries: how many clouds are judged. max_points: the most points of the
    combination that may differ from the clean ones; None for any number.
    """

    def __init__(
        self,
        goal: AttackGoal,
        detector: ObjectDetector,
        clean: Float32,
        found: Detections,
        owner: Int64,
        focus: Focus,
        tries: int,
        max_points: int | None = None,
    ) -> None:
        self._goal, self._detector, self._owner, self._focus = goal, detector, owner, focus
        self._clean, self._max_points = clean, max_points
        self._best, self._success = clean.copy(), goal.success(found)  # of each object
        self._clean_success = self._success
        self.candidates = tries - 1 if tries >= LEAST_TRIES else tries
        """How many candidates are judged, beside the combination."""
        self._until_combination = math.ceil(COMBINED_AFTER * tries) if tries >= LEAST_TRIES else -1
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
        self._until_combination -= 1
        if self._until_combination == 0 or (self._until_combination > 0 and not self._focus.is_open.any()):
            self._judge_combination()
        return taken

    def combined(self) -> Float32:
        """The best points (N, 4) of each object; where they are more than `max_points`, those of the objects
        with the most success a point."""
        gain = self._success - self._clean_success
        return within_limit(self._best, self._clean, self._owner, gain, self._max_points)

    def _judge_combination(self) -> None:
        self._until_combination = -1
        self._best = self.combined()
        self._success = self._goal.success(self._detector.detect(cloud_of_xyzi(self._best)))
        self._focus.open(~self._goal.is_done(self._success))


def within_limit(
    moved: Float32, clean: Float32, owner: Int64, gain: Float64, max_points: int | None
) -> Float32:
    """The moved points (N, 4), those of objects with a small gain (M,) a point back in their clean places, so
    that at most `max_points` differ from the clean ones; None for any number."""
    count = np.bincount(owner[(moved != clean).any(axis=1)], minlength=len(gain))
    kept = moved.copy()
    if max_points is None or count.sum() <= max_points:
        return kept
    left = max_points
    for number in np.argsort(-gain / np.maximum(count, 1), kind="stable").tolist():
        if count[number] <= left:
            left -= int(count[number])
        else:
            kept[owner == number] = clean[owner == number]
    return kept
