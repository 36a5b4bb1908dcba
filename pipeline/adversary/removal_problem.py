"""Random removal of points near objects, as an allocation problem: which points each object loses."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.greedy_allocation import greedy_allocation
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

MAX_SHARE_PER_OBJECT = 0.85
"""The largest share of its points that an object may lose during the search."""


@dataclass(eq=False)
class RemovalProblem:
    """The items are points of the clean cloud, (N, 4); taking one removes it. It proposes random points.

    owner: (N,) the object of the goal that each point belongs to, -1 for one that must not be touched.
    """

    points: Float32
    owner: Int64
    objective: AttackObjective
    rng: np.random.Generator
    focus: Focus = field(init=False)

    def __post_init__(self) -> None:
        self.focus = Focus(self.points, self.objective.goal.targets.boxes.double().numpy())

    @property
    def max_items(self) -> Int64:
        of_object = np.bincount(self.owner[self.owner >= 0], minlength=len(self.objective.goal.targets))
        most: Int64 = np.ceil(MAX_SHARE_PER_OBJECT * of_object).astype(np.int64)
        return most

    @property
    def clean_values(self) -> Float64:
        return self.objective.clean_values

    def look(self, taken: Int64, *, will_propose: bool) -> Float64:
        left = np.setdiff1d(self.focus.shown, taken, assume_unique=True)
        return self.objective.value(self.detected(self.points[left], left, will_propose))

    def propose(self, taken: Int64, wanted: Int64, room: Int64) -> list[Int64]:
        left = np.setdiff1d(np.arange(len(self.points)), taken, assume_unique=True)
        gain, group = self.gains(left)
        proposals = []
        for number, (count, most) in enumerate(zip(wanted.tolist(), room.tolist(), strict=True)):
            mine = np.flatnonzero(self.owner[left] == number) if count else np.zeros(0, np.int64)
            proposals.append(left[mine[_whole_groups(gain[mine], group[mine], count, most)]])
        return proposals

    def evaluate(self, taken: Int64) -> Float64:
        return self.objective(np.delete(self.points, taken, axis=0))

    def is_satisfied(self, values: Float64) -> Bool:
        return self.objective.is_satisfied(values)

    def detected(self, points: Float32, left: Int64, will_propose: bool) -> Detections:
        """What the detector finds in these points, (K, 4), which are those `left`, (K,)."""
        del left, will_propose
        return self.objective.detector.detect(cloud_of_xyzi(points))

    def gains(self, left: Int64) -> tuple[Float64, Int64]:
        """The estimated gain of removing each remaining point, and its group: points that count together."""
        return self.rng.random(len(left)), np.arange(len(left))


def remove_greedily(problem: RemovalProblem, allowed: Int64, count: int, tries: int) -> tuple[Int64, int]:
    """`count` of the allowed points, allocated to the objects greedily, and how many of these are random ones
    because no other would help."""
    chosen = np.concatenate(greedy_allocation(problem, count, tries))[:count]
    return with_random_rest(chosen, allowed, count, problem.rng)


def with_random_rest(
    chosen: Int64, allowed: Int64, count: int, rng: np.random.Generator
) -> tuple[Int64, int]:
    """`count` of the allowed points: the chosen ones first, then random others, and how many those are."""
    short = count - len(chosen)
    rest = np.setdiff1d(allowed, chosen, assume_unique=True)
    return np.concatenate([chosen, rng.choice(rest, size=short, replace=False)]), short


def _whole_groups(gain: Float64, group: Int64, count: int, room: int) -> Int64:
    """Indices (K,) of whole groups in order of positive gain per point, until there are `count` points;
    groups larger than the remaining `room` are skipped, unless none fits."""
    order = np.lexsort((group, -gain))
    order = order[gain[order] > 0]
    if not count or not len(order):
        return np.zeros(0, np.int64)
    chosen: list[Int64] = []
    size = 0
    for members in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        if size + len(members) <= room:
            chosen.append(members)
            size += len(members)
        if size >= count:
            break
    return np.concatenate(chosen) if chosen else order[:room]
