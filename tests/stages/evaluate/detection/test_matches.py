"""The matches of a frame are kept in one array for all pairs of criterion and class."""

import pickle

import numpy as np
import pytest

from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.metrics.matching import match_frame
from advpipe.stages.evaluate.detection.matches import labelled
from advpipe.stages.evaluate.detection.scoring import CRITERIA, Truth, false_positives, found_objects, match

KNOWN = ("car", "pedestrian")


@pytest.fixture
def scene():
    """Objects of all classes, of which the fourth is not evaluated, and detections of two classes."""
    rng = np.random.default_rng(5)
    geometry = np.tile([0.0, 0.0, -1.0, 4.0, 1.8, 1.6, 0.0], (12, 1))
    geometry[:, 0] = 6.0 * np.arange(12)
    labels = np.arange(12) % len(CLASSES)
    known = np.isin(labels, [CLASSES.index(name) for name in KNOWN])
    evaluated = known & (np.arange(12) != 3)
    truth = Truth(
        Boxes(geometry, labels, ("",) * 12, np.zeros((12, 3))), known, evaluated, labels, labels / 4
    )
    boxes = geometry[[0, 0, 3, 4, 7, 8, 11, 2]] + rng.normal(0, 0.2, (8, 7)) * [1, 1, 0, 0, 0, 0, 0]
    theirs = np.array([CLASSES.index(name) for name in ("car", "car", *(KNOWN * 3))])
    return truth, Detections(boxes, np.linspace(0.9, 0.2, 8), theirs)


def test_each_pair_is_what_matching_it_alone_gives(scene):
    truth, detections = scene
    matches = pickle.loads(pickle.dumps(match(truth, detections, KNOWN)))
    assert list(matches) == [(criterion, name) for name in KNOWN for criterion in CRITERIA]
    for name in KNOWN:
        mine, theirs = labelled(truth.boxes.labels, name), labelled(detections.labels, name)
        alone = match_frame(
            truth.boxes.geometry[mine],
            truth.is_evaluated[mine],
            detections.boxes[theirs],
            detections.scores[theirs],
            CRITERIA["loose"].min_iou[name],
            iou_3d,
        )
        for field, value in vars(alone).items():
            np.testing.assert_array_equal(getattr(matches["loose", name], field), value, err_msg=field)
    with pytest.raises(KeyError):
        matches["loose", "truck"]


def test_all_classes_together_are_the_classes_in_turn(scene):
    truth, detections = scene
    matches = match(truth, detections, KNOWN)
    found, wrong = found_objects(matches, 0.4), false_positives(matches, 0.4)
    for name in KNOWN:
        mine, theirs = labelled(truth.boxes.labels, name), labelled(detections.labels, name)
        np.testing.assert_array_equal(found[mine], matches["loose", name].found(0.4))
        np.testing.assert_array_equal(wrong[theirs], matches["loose", name].is_false_positive(0.4))
    assert found.any()
    assert wrong.any()
    assert not found[~truth.is_evaluated].any()


def test_scores_of_a_detector_in_single_precision_become_double(scene):
    """What adds them up would lose digits over a drive, and figures of several detectors would differ."""
    truth, detections = scene
    single = Detections(detections.boxes, detections.scores.astype(np.float32), detections.labels)
    matches = match(truth, single, KNOWN)
    assert matches.scores.dtype == matches["loose", "car"].scores.dtype == np.float64
    np.testing.assert_array_equal(matches.scores, single.scores)
