"""The temporal check: objects that drive on are consistent; those that vanish, appear or jump are not."""

import numpy as np
import pytest

from advpipe.pipeline.attack_detection import temporal
from advpipe.pipeline.attack_detection.temporal import MIN_RUN
from advpipe.pipeline.detector.protocol import Detections

FRAMES = MIN_RUN + 5
STAMPS_NS = np.arange(FRAMES) * 100_000_000
SPEEDS_MPS = np.array([[15.0, 0.0, 0.0], [-12.0, 1.0, 0.0], [0.0, 0.0, 0.0], [3.0, -2.0, 0.0]])
STARTS_M = np.array([[-30.0, 3.0, -1.0], [40.0, -3.0, -1.0], [10.0, 12.0, -1.0], [5.0, -15.0, -1.0]])
LABELS = np.array([0, 0, 1, 3])


def temporal_scores(stamps_ns, detections):
    return temporal.temporal_scores(stamps_ns, detections, min_score=0.3)


def driving(number):
    """Four objects that go on at their speeds; what is found of them shakes by some 5 cm."""
    rng = np.random.default_rng(number)
    boxes = np.zeros((4, 7))
    boxes[:, :3] = STARTS_M + SPEEDS_MPS * (0.1 * number) + rng.normal(0, 0.05, (4, 3))
    return Detections(boxes, np.full(4, 0.8), LABELS)


def only(found, kept):
    kept = np.asarray(kept)
    return Detections(found.boxes[kept], found.scores[kept], found.labels[kept])


def test_objects_that_drive_on_are_consistent():
    scores = temporal_scores(STAMPS_NS, [driving(number) for number in range(FRAMES)])
    assert np.isnan(scores[:2]).all()
    assert (scores[2:] < 0.05).all()


@pytest.mark.parametrize("what", ["vanishes", "appears", "jumps"])
def test_what_is_not_predicted_stands_out(what):
    found = [driving(number) for number in range(FRAMES)]
    quiet = temporal_scores(STAMPS_NS, found)
    if what == "vanishes":
        found[20] = only(found[20], [0, 1, 3])
    elif what == "appears":
        boxes = np.concatenate([found[20].boxes, [[8.0, 0.0, -1.0, 0, 0, 0, 0]]])
        found[20] = Detections(boxes, np.full(5, 0.8), np.append(LABELS, 0))
    else:
        found[20].boxes[2, 0] += 1.4
    loud = temporal_scores(STAMPS_NS, found)
    assert loud[20] > np.nanmax(quiet) + 0.05
    np.testing.assert_array_equal(loud[:20], quiet[:20])


def test_a_score_that_goes_below_the_least_one_is_no_object_that_vanishes():
    found = [driving(number) for number in range(FRAMES)]
    quiet = temporal_scores(STAMPS_NS, found)
    found[20].scores[2] = 0.29
    assert np.nanmax(temporal_scores(STAMPS_NS, found)) < np.nanmax(quiet) + 0.02


def test_a_faint_detection_is_not_judged():
    found = [driving(number) for number in range(FRAMES)]
    quiet = temporal_scores(STAMPS_NS, found)
    boxes = np.concatenate([found[20].boxes, [[60.0, 40.0, -1.0, 0, 0, 0, 0]]])
    found[20] = Detections(boxes, np.append(found[20].scores, 0.2), np.append(LABELS, 0))
    np.testing.assert_array_equal(temporal_scores(STAMPS_NS, found), quiet)


def test_an_object_of_another_class_is_no_prediction():
    found = [driving(number) for number in range(FRAMES)]
    found[20] = Detections(found[20].boxes, found[20].scores, np.array([0, 0, 0, 3]))
    assert temporal_scores(STAMPS_NS, found)[20] > 0.3


def test_gaps_divide_runs_and_short_runs_say_nothing():
    stamps_ns = STAMPS_NS.copy()
    stamps_ns[MIN_RUN:] += 1_000_000_000
    scores = temporal_scores(stamps_ns, [driving(number) for number in range(FRAMES)])
    assert np.isfinite(scores[2:MIN_RUN]).all()
    assert np.isnan(scores[MIN_RUN:]).all()
    assert np.isnan(temporal_scores(STAMPS_NS[: MIN_RUN - 1], [driving(0)] * (MIN_RUN - 1))).all()


def test_nothing_detected_is_consistent():
    nothing = Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))
    assert (temporal_scores(STAMPS_NS, [nothing] * FRAMES)[2:] == 0).all()
