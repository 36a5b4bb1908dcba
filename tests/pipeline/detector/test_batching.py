"""Tasks that share one detector: their results, the composition of batches, and errors."""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import torch

sys.path.insert(0, str(Path(__file__).parents[2] / "stages" / "attack"))

from linear_detector import BOX, LinearVoxelDetector

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.batching import run_batched
from advpipe.pipeline.detector.protocol import VoxelDetector
from advpipe.pipeline.messages.cloud import POINT_DTYPE

BOXES, LABELS = torch.tensor([BOX]), torch.tensor([0])


class Batches(LinearVoxelDetector):
    """A batch detector whose results can be computed by hand; it records its batches.

    It refuses points that are not finite, and more than `most` clouds in a batch.
    """

    def __init__(self, most: int = 99) -> None:
        super().__init__(np.random.default_rng(9).uniform(0.1, 1, (10, 10, 10)), [BOX])
        self.most = most
        self.batches: list[tuple[str, int]] = []
        self.threads: set[int] = set()

    def _note(self, kind, clouds):
        self.batches.append((kind, len(clouds)))
        self.threads.add(threading.get_ident())
        if len(clouds) > self.most:
            raise torch.OutOfMemoryError("no room")
        if not all(torch.isfinite(cloud).all() for cloud in clouds):
            raise AdvpipeError("not finite")

    def detect_batch(self, clouds):
        self._note("detect", clouds)
        return [self.detect(cloud_of(cloud)) for cloud in clouds]

    def loss_batch(self, inputs):
        self._note("loss", [each.points for each in inputs])
        return [self.loss(each.points, each.boxes, each.labels) for each in inputs]

    def occupancy_loss_batch(self, inputs):
        self._note("occupancy_loss", [each.points for each in inputs])
        return [self.occupancy_loss(each.points, each.boxes, each.labels, each.probes) for each in inputs]


def cloud_of(points):
    cloud = np.zeros(len(points), POINT_DTYPE)
    for column, name in enumerate(("x", "y", "z", "intensity")):
        cloud[name] = points[:, column].numpy()
    return cloud


def points_of(number: int) -> torch.Tensor:
    points = np.random.default_rng(number).uniform(0, 10, (50 + number, 4))
    return torch.from_numpy(points.astype(np.float32))


def asks_everything(number: int):
    """Every answer and gradient that a detector has for a cloud of this number."""

    def work(detector):
        assert isinstance(detector, VoxelDetector)
        leaf, probes = points_of(number).requires_grad_(), points_of(100 + number)[:5]
        loss = detector.loss(0.9 * leaf, BOXES, LABELS)  # not of a leaf
        (to_points,) = torch.autograd.grad(2 * loss, leaf)
        with torch.no_grad():
            still = detector.loss(leaf, BOXES, LABELS)
        assert not still.requires_grad
        computed = detector.occupancy_loss(leaf, BOXES, LABELS, probes)
        of_occupancy, occupancy, rows = computed.loss, computed.occupancy, computed.rows
        assert occupancy.is_leaf
        assert occupancy.requires_grad
        gradients = torch.autograd.grad(of_occupancy, [occupancy, leaf])
        found = detector.detect(cloud_of(points_of(number)))
        parts = [loss, to_points, still, of_occupancy, occupancy, rows, *gradients]
        return [*(part.detach().numpy() for part in parts), found.boxes, found.scores, found.labels]

    return work


def test_each_task_gets_the_results_of_an_unbatched_detector():
    detector = Batches()
    works = [asks_everything(number) for number in range(5)]
    for result, work in zip(run_batched(detector, works), works, strict=True):
        for part, wanted in zip(result, work(Batches()), strict=True):
            np.testing.assert_array_equal(part, wanted)
    assert detector.batches == [("loss", 5)] * 2 + [("occupancy_loss", 5), ("detect", 5)]
    assert detector.threads == {threading.get_ident()}
    assert detector.voxel_grid == Batches.voxel_grid


def test_second_derivatives_are_refused():
    def work(detector):
        leaf = points_of(0).requires_grad_()
        (gradient,) = torch.autograd.grad(detector.loss(leaf, BOXES, LABELS), leaf, create_graph=True)
        gradient.sum().backward()

    with pytest.raises(RuntimeError, match="does not require grad"):
        run_batched(Batches(), [work, work])


def requests_of(*kinds, pause_s=0.0):
    """A task that sends these requests in sequence."""

    def work(detector):
        for kind in kinds:
            time.sleep(pause_s)
            if kind == "detect":
                detector.detect(cloud_of(points_of(0)))
            else:
                getattr(detector, kind)(points_of(0), BOXES, LABELS)

    return work


@pytest.mark.parametrize("slow", range(3))
def test_batches_do_not_depend_on_timing(slow):
    detector = Batches()
    calls = [("loss", "detect", "loss"), ("detect", "loss"), ("loss", "loss", "detect", "detect", "loss")]
    run_batched(detector, [requests_of(*each, pause_s=0.02 * (n == slow)) for n, each in enumerate(calls)])
    # Two ask for a loss, so the detection of the second one waits, and is in step with the first one's then.
    assert detector.batches == [
        *[("loss", 2), ("detect", 2), ("loss", 3)],
        *[("detect", 1), ("detect", 1), ("loss", 1)],
    ]


def broken(number: int) -> torch.Tensor:
    points = points_of(number)
    points[3, 1] = torch.nan
    return points


def test_the_error_of_an_input_is_raised_only_in_its_task():
    def caught(detector):
        with pytest.raises(AdvpipeError, match="not finite"):
            detector.loss(broken(1), BOXES, LABELS)
        return float(detector.loss(points_of(1), BOXES, LABELS).detach())

    def good(detector):
        return [float(detector.loss(points_of(n), BOXES, LABELS).detach()) for n in (2, 3)]

    results = run_batched(Batches(), [good, caught, good])
    alone = float(Batches().loss(points_of(1), BOXES, LABELS).detach())
    assert results == [good(Batches()), alone, good(Batches())]


def test_a_batch_too_large_is_computed_one_by_one():
    detector = Batches(most=1)
    run_batched(detector, [requests_of("loss"), requests_of("loss")])
    assert detector.batches == [("loss", 2), ("loss", 1), ("loss", 1)]


@pytest.mark.parametrize("error", [AdvpipeError, KeyboardInterrupt, ZeroDivisionError])
def test_the_first_uncaught_error_stops_all_tasks(error):
    ended = []

    def endless(detector):
        try:
            while True:
                detector.loss(points_of(0), BOXES, LABELS)
        finally:
            ended.append(True)

    def fails(line):
        def work(detector):
            requests_of("loss", "loss")(detector)
            raise error(line)

        return work

    before = threading.active_count()
    with pytest.raises(error, match="first"):
        run_batched(Batches(), [endless, fails("first"), endless, fails("second")])
    assert ended == [True, True]
    assert threading.active_count() == before


def test_an_interruption_during_a_batch_stops_all_tasks():
    class Interrupted(Batches):
        def detect_batch(self, clouds):
            raise KeyboardInterrupt

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        run_batched(Interrupted(), [requests_of("loss", "detect"), requests_of("loss", "detect", "loss")])
    assert threading.active_count() == before


def test_tasks_without_requests_finish():
    assert run_batched(Batches(), [lambda detector: detector.classes, lambda detector: 7]) == [("car",), 7]
    assert run_batched(Batches(), []) == []
