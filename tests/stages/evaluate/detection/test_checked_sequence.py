"""The temporal check on the frames of an evaluation: which it judges, and by which clouds before them."""

import numpy as np

from advpipe.pipeline.attack_detection.temporal import MIN_RUN
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.stages.evaluate.detection.checked_sequence import checked_sequence
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.scoring import Truth, match

NOBODY = Truth(Boxes(), np.zeros(0, bool), np.zeros(0, bool), np.zeros(0, np.int64), np.zeros(0))


def cloud(number, removed=0, scores=(0.9, 0.8)):
    """Two cars, one of which drives on; a third box has a score too low to act on."""
    boxes = np.zeros((len(scores), 7))
    boxes[:2, 0] = [10.0 + number, 20.0][: len(scores)]
    boxes[1:, 1] = 8.0
    found = Detections(boxes, np.array(scores), np.zeros(len(scores), np.int64))
    return CloudResult(
        found, match(NOBODY, found, ()), np.zeros(len(scores), np.int64), 100, points_removed=removed
    )


def frame(number, attacked=None):
    return FrameResult(number, number, 100_000_000 * number, NOBODY, cloud(number), attacked)


def test_attacked_clouds_are_judged_by_attacked_ones():
    """From frame 10 on the second car is hidden: it vanishes once, and then nobody expects it."""
    frames = [
        frame(number, cloud(number, removed=10, scores=(0.9,)) if number >= 10 else cloud(number))
        for number in range(MIN_RUN + 2)
    ]
    checked = checked_sequence(frames)
    assert len(checked) == MIN_RUN
    assert [each.attacked is not None for each in checked] == [number >= 10 for number in range(2, 32)]
    assert all(each.clean.score < 1e-6 for each in checked)
    scores = [each.attacked.score for each in checked if each.attacked]
    assert scores[0] > 0.4
    assert max(scores[1:]) < 1e-6


def test_a_box_that_nobody_acts_on_is_not_judged():
    frames = [
        frame(number, cloud(number, removed=1, scores=(0.9, 0.8, 0.1) if number % 2 else (0.9, 0.8)))
        for number in range(MIN_RUN)
    ]
    assert all(each.attacked.score < 1e-6 for each in checked_sequence(frames))


def test_few_frames_are_no_run():
    assert checked_sequence([frame(number) for number in range(MIN_RUN - 1)]) == []
