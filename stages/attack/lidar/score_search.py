"""A score-based search for detectors that show no more than detections and the gradient of a loss.

Objects hardly affect each other, so each candidate is a trial for every one of them. In a trial, an object's
points are deformed together, scattered, or moved along the gradient of the loss, from their measured places
or from those of the object's best trial so far. What has improved objects more often is drawn more often, so
that a poor gradient costs little.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.adaptive_choice import AdaptiveChoice
from advpipe.pipeline.adversary.constraints import Rules
from advpipe.pipeline.adversary.displacement import displaced
from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import NoGradientError
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.stages.attack.lidar.pgd import loss_gradient
from advpipe.stages.attack.lidar.search import Candidate

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

MOVES = ("deform", "scatter", "gradient")
CHOICES = [(move, from_best) for move in MOVES for from_best in (False, True)]

STEP_FROM_BEST = 0.5
"""How far points move from an object's best trial, as a fraction of the reach."""

SHEAR = 0.3
"""The standard deviation of shears and turns, where that of shifts and stretches is 1."""


class ScoreSearch:
    """The search on one cloud of points (N, 4), all finite; a `Search`."""

    def __init__(
        self,
        points: Float32,
        goal: AttackGoal,
        detector: ObjectDetector,
        rules: Rules,
        owner: Int64,
        focus: Focus,
        reach_m: float,
        rng: np.random.Generator,
    ) -> None:
        """owner: (N,) the object that each point belongs to; points with -1 stay. focus: the part of the
        points that is looked at. reach_m: how far a point may move."""
        self.points, self.goal, self.detector, self.rules = points, goal, detector, rules
        self.focus, self.reach_m, self.rng = focus, reach_m, rng
        movable = rules.limit(np.where(rules.allowed & (owner >= 0), rng.random(len(points)), 0.0))
        self.members = [np.flatnonzero(movable & (owner == number)) for number in range(len(goal.regions))]
        objects, decoys = AdaptiveChoice(len(CHOICES), rng), AdaptiveChoice(len(CHOICES), rng)
        self.choices = [objects] * len(goal.targets) + [decoys] * len(goal.decoys)
        self.has_gradient = True
        self.best, self.latest = points.copy(), points
        self.drawn: dict[int, int] = {}

    def candidates(self, steps: int) -> Iterator[Candidate]:
        """`steps` candidates; as many gradients, if there are any."""
        start = self.points[:, :3].astype(np.float64)
        for _ in range(steps):
            uphill = self._uphill()
            offset_m, intensity = self.best[:, :3] - start, self.best[:, 3].copy()
            self.drawn = {}
            for number in np.flatnonzero(self.focus.is_open).tolist():
                mine = self.members[number]
                can = [
                    (move != "gradient" or bool(uphill[mine].any()))
                    and (not from_best or bool(offset_m[mine].any()))
                    for move, from_best in CHOICES
                ]
                self.drawn[number] = self.choices[number].draw(np.array(can))
                move, from_best = CHOICES[self.drawn[number]]
                way = self._way(move, start[mine], uphill[mine], self.goal.regions[number])
                step = from_best * offset_m[mine] + (STEP_FROM_BEST if from_best else 1) * self.reach_m * way
                length_m = np.linalg.norm(step, axis=1, keepdims=True)
                offset_m[mine] = step * np.minimum(1.0, self.reach_m / np.maximum(length_m, 1e-30))
                intensity[mine] = self._intensities(intensity[mine])
            self.latest = displaced(self.points, self.rules.project(offset_m), self.reach_m)
            self.latest[:, 3] = intensity
            yield Candidate(self.latest)

    def accept(self, better: Bool) -> None:
        """Continue from the points of the objects whose latest trial is the best so far."""
        for number, drawn in self.drawn.items():
            self.choices[number].learn(drawn, is_success=bool(better[self.members[number]].any()))
        self.best[better] = self.latest[better]

    def _way(self, move: str, start: Float64, uphill: Float64, box: Float64) -> Float64:
        """How points at `start` (K, 3) of the object in a box (7,) move, in units of the reach: (K, 3)."""
        if move == "gradient":
            way = uphill
        elif move == "scatter":
            way = self.rng.standard_normal(start.shape)
        else:  # a shift, stretches, shears and turns in the box's frame, of length 1 on average
            cos, sin = np.cos(box[6]), np.sin(box[6])
            lidar_R_box = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
            place = (start - box[:3]) @ lidar_R_box / (box[3:6] / 2)
            draw = self.rng.standard_normal
            field = place @ (np.diag(draw(3)) + SHEAR * draw((3, 3))) + draw(3)
            root_mean_square = np.sqrt(np.square(field).sum(axis=1).mean()) if len(field) else 1.0
            deformed: Float64 = field @ lidar_R_box.T / root_mean_square
            return deformed
        unit: Float64 = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-30)
        return unit

    def _intensities(self, known: Float32) -> Float32:
        """The intensities (K,) of an object's points: drawn anew in half of the trials if they are attacked,
        for each point or one for all."""
        if not self.rules.constraints.intensity or self.rng.random() < 0.5:
            return known
        lowest, highest = self.points[:, 3].min(), self.points[:, 3].max()
        count = len(known) if self.rng.random() < 0.5 else 1
        return np.resize(self.rng.uniform(lowest, highest, count), len(known)).astype(np.float32)

    def _uphill(self) -> Float64:
        """The gradient (N, 3) of the loss at the best points that the focus shows, in the attack's direction;
        0 if there is none."""
        uphill, shown = np.zeros((len(self.points), 3)), self.focus.shown
        if self.has_gradient and len(shown):
            try:
                at = torch.from_numpy(self.best[shown])
                slope = loss_gradient(at, torch.zeros(len(shown), 3), self.goal, self.detector)
                uphill[shown] = self.goal.sign * slope.double().cpu().numpy()
            except NoGradientError:
                self.has_gradient = False
        return uphill
