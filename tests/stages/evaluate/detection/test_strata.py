"""Parts of the objects by range, points and occlusion: three frames worked by hand."""

import numpy as np
import pytest

from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.metrics.bootstrap import BlockBootstrap
from advpipe.stages.evaluate.detection.comparison import CloudResult, FrameResult
from advpipe.stages.evaluate.detection.condition import Arm
from advpipe.stages.evaluate.detection.scoring import Truth, match
from advpipe.stages.evaluate.detection.strata import STRATA, Stratum


def cars(*places: tuple[float, float]) -> np.ndarray:
    return np.array([[x, y, 0.0, 4.0, 2.0, 1.5, 0.0] for x, y in places]).reshape(-1, 7)


def frame(index, places, points, occlusion, found, scores, box_points) -> FrameResult:
    n = len(places)
    boxes = Boxes(cars(*places), np.zeros(n, np.int64), tuple(map(str, range(n))), np.zeros((n, 3)))
    truth = Truth(
        boxes, np.ones(len(points), bool), np.array(points) >= 5, np.array(points), np.array(occlusion, float)
    )
    detections = Detections(cars(*found), np.array(scores, float), np.zeros(len(found), np.int64))
    result = CloudResult(detections, match(truth, detections, CLASSES), np.array(box_points), points=1000)
    return FrameResult(index, -1, index * 10**9, truth, result)


FRAMES = [
    # near, hit by many points, found; at 31.6 m, few points, half hidden, missed
    frame(0, [(10, 0), (30, 10)], [300, 8], [0.0, 0.5], [(10, 0)], [0.9], [290]),
    # a false positive at 45 m that scores best, on 30 points; a car at 40 m that is found
    frame(1, [(40, 0)], [30], [0.2], [(40, 20), (40, 0)], [0.95, 0.8], [30, 28]),
    # a car with 2 points is not evaluated: what finds it counts nowhere; a false positive on 3 points
    frame(2, [(20, 0)], [2], [0.9], [(20, 0), (55, 0)], [0.99, 0.3], [2, 3]),
]


@pytest.fixture(scope="module")
def precisions():
    bootstrap = BlockBootstrap.of([f.stamp_ns for f in FRAMES], 10, np.random.default_rng(0))
    arm = Arm.of(FRAMES, "clean", CLASSES, ["car"], bootstrap)
    found = arm.precisions(FRAMES, "clean")
    return {(each.name, each.criterion, each.by, each.stratum): each for each in found}


def test_all_objects(precisions):
    whole = precisions["car", "strict", "", "all"]
    # F(.95) T(.9) T(.8) F(.3) over 3 cars: 2/3 up to recall 2/3, at 26 of 40 positions
    assert whole.boxes == 3
    assert whole.ap_r40 == pytest.approx(26 * 2 / 3 / 40)
    assert whole.ap_r11 == pytest.approx(7 * 2 / 3 / 11)  # 0, .1, ... .6
    assert precisions["car", "bev_loose", "", "all"].ap_r40 == whole.ap_r40


@pytest.mark.parametrize(
    ("by", "stratum", "boxes", "ap_r40"),
    [
        ("range", "0-30 m", 1, 1.0),
        ("range", "30-50 m", 2, 20 * 0.5 / 40),  # the false positive at 45 m first, then one of two
        ("range", "over 50 m", 0, np.nan),
        ("points", "5-19", 1, 0.0),
        ("points", "20-99", 1, 0.5),  # the false positive on 30 points first
        ("points", "100+", 1, 1.0),
        ("occlusion", "0-10 %", 1, 0.5),  # every false positive counts
        ("occlusion", "10-50 %", 1, 0.5),
        ("occlusion", "over 50 %", 1, 0.0),
    ],
)
def test_strata_by_hand(precisions, by, stratum, boxes, ap_r40):
    part = precisions["car", "strict", by, stratum]
    assert part.boxes == boxes
    assert part.ap_r40 == pytest.approx(ap_r40, nan_ok=True)


def test_a_class_without_objects_is_undefined(precisions):
    assert precisions["truck", "strict", "", "all"].boxes == 0
    assert np.isnan(precisions["truck", "strict", "", "all"].ap_r40)


def test_strata_of_a_measure_leave_no_gap_and_no_overlap():
    for by in ("range", "points", "occlusion"):
        parts = [stratum for stratum in STRATA if stratum.by == by]
        values = np.array([0, 4.999, 5, 19, 20, 29.999, 30, 50, 99, 100, 1e6, 0.1, 0.5, 1.0])
        values = values[values >= parts[0].low]
        assert (sum(part.holds(values).astype(int) for part in parts) == 1).all()


def test_an_unknown_measure_lies_nowhere():
    assert not Stratum("occlusion", "any", 0, np.inf).holds(np.array([np.nan])).any()


def test_without_occlusion_there_are_no_strata_of_it():
    frames = [frame(0, [(10, 0)], [300], [np.nan], [(10, 0)], [0.9], [290])]
    bootstrap = BlockBootstrap.of([0], 10, np.random.default_rng(0))
    found = list(Arm.of(frames, "clean", CLASSES, ["car"], bootstrap).precisions(frames, "clean"))
    assert {each.by for each in found} == {"", "range", "points"}
