"""The best points of each object, and their combination."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from advpipe.pipeline.adversary.focus import Focus
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.per_object_best import PerObjectBest, within_limit
from advpipe.pipeline.adversary.targets import AttackTargets
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import xyz

BOXES = np.array([[10.0, 0, 0, 4, 2, 1.5, 0], [10.0, 5, 0, 4, 2, 1.5, 0]])
CLEAN = np.array([[10, 0, 0, 0.5], [10, 5, 0, 0.5]], np.float32)
OWNER = np.array([0, 1])


class Neighbours:
    """Finds a car when its point is not raised, and the second one also when both points are."""

    classes = ("car",)

    def __init__(self):
        self.asked = 0

    def detect(self, cloud):
        self.asked += 1
        return found(*self.cars(xyz(cloud)[:, 2] > 0))

    def cars(self, raised):
        return [number for number in (0, 1) if not raised[number] or (number == 1 and raised.all())]


def found(*cars):
    labels = np.zeros(len(cars), np.int64)
    return Detections(BOXES[list(cars)], np.full(len(cars), 0.9, np.float32), labels)


def raised(*points):
    candidate = CLEAN.copy()
    candidate[list(points), 2] = 0.1
    return candidate


@pytest.fixture
def goal():
    targets = AttackTargets(torch.from_numpy(BOXES).float(), torch.zeros(2).long())
    return AttackGoal(targets, targets, 1.0, "break", ("car",))


@pytest.fixture
def search(goal):
    def started(tries, max_points=None):
        detector, focus = Neighbours(), Focus(CLEAN, BOXES)
        best = PerObjectBest(goal, detector, CLEAN, found(0, 1), OWNER, focus, tries, max_points)
        return best, detector, focus

    return started


def test_objects_that_the_combination_shows_again_are_opened_again(search):
    best, detector, focus = search(8)
    assert best.candidates == 7
    assert best.update(raised(0), found(1)).tolist() == [True, False]
    assert focus.is_open.tolist() == [False, True]
    assert best.update(raised(1), found(0)).tolist() == [
        False,
        True,
    ]  # all are done: the combination is judged
    assert detector.asked == 1  # about the combination
    assert focus.is_open.tolist() == [False, True]
    better = raised(0, 1)
    better[1, 0] = 11
    assert best.update(better, found()).tolist() == [False, True]
    assert not focus.is_open.any()
    assert best.combined().tolist() == better.tolist()
    assert detector.asked == 1  # one combination alone is judged


def test_the_combination_is_judged_when_a_quarter_of_the_tries_is_left(search):
    best, detector, _ = search(8)
    for asked in (0, 0, 0, 0, 0, 1, 1):
        best.update(CLEAN, found(0, 1))
        assert detector.asked == asked


def test_all_of_few_tries_are_candidates(search):
    best, detector, _ = search(3)
    assert best.candidates == 3
    for _ in range(3):
        best.update(CLEAN, found(0, 1))
    assert detector.asked == 0


def test_the_combination_moves_as_many_points_as_it_may(search):
    best, _, focus = search(8, max_points=1)
    best.update(raised(0), found(1))
    best.update(raised(1), found(0))
    assert (best.combined() != CLEAN).any(axis=1).sum() == 1
    assert focus.is_open.tolist() == [False, True]  # its point is back in its clean place


def test_points_of_most_gain_a_point_stay_within_the_limit():
    clean = np.zeros((6, 4), np.float32)
    moved = clean + 1
    owner = np.array([0, 0, 0, 1, 2, 2])
    gain = np.array([0.9, 0.2, 0.8])
    kept = [
        (within_limit(moved, clean, owner, gain, most) == moved).all(axis=1).tolist()
        for most in (None, 3, 2, 1)
    ]
    assert kept == [
        [True] * 6,
        [False, False, False, True, True, True],  # .4, .3 and .2 a point
        [False, False, False, False, True, True],
        [False, False, False, True, False, False],
    ]
