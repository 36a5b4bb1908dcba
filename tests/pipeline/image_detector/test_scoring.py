"""Average precision in pictures, by numbers worked by hand and against KITTI's own program."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.image_detector.protocol import ImageDetections
from advpipe.pipeline.image_detector.scoring import PictureTruth, picture_precisions, picture_scores
from advpipe.pipeline.messages.labels import ImageLabel
from advpipe.pipeline.metrics.kitti import kitti_precisions
from advpipe.pipeline.metrics.kitti_objects import KittiObjects

CAR = (100.0, 100.0, 200.0, 150.0)


def label(
    edges: tuple[float, ...] = CAR, name: str = "Car", occlusion: int = 0, truncation: float = 0.0
) -> ImageLabel:
    return ImageLabel("1", name, edges, truncation, occlusion)  # type: ignore[arg-type]


def found(*rows: tuple[tuple[float, ...], float, int]) -> ImageDetections:
    return ImageDetections(
        np.array([row[0] for row in rows], np.float32).reshape(-1, 4),
        np.array([row[1] for row in rows], np.float32),
        np.array([row[2] for row in rows], np.int64),
    )


def precision(
    truth: list[list[ImageLabel]], detections: list[ImageDetections], difficulty: str = "moderate"
) -> tuple[int, float, float]:
    rows = picture_precisions([PictureTruth.of(each) for each in truth], detections, ("car",))
    (row,) = [each for each in rows if each.difficulty == difficulty]
    return row.objects, row.strict, row.half


def moved(pixels: float) -> tuple[float, ...]:
    return (CAR[0] + pixels, CAR[1], CAR[2] + pixels, CAR[3])


def test_a_perfect_detector_has_all_of_it() -> None:
    assert precision([[label()], [label()]], [found((CAR, 0.9, 0)), found((CAR, 0.8, 0))]) == (2, 1.0, 1.0)


def test_a_shift_of_a_quarter_matches_at_half_alone() -> None:
    # 75 of 125 columns are shared: an IoU of 0.6
    assert precision([[label()]], [found((moved(25), 0.9, 0))]) == (1, 0.0, 1.0)


def test_a_false_alarm_before_the_second_object_costs_a_sixth() -> None:
    truth = [[label(), label((300.0, 100.0, 400.0, 150.0))]]
    far = (500.0, 100.0, 600.0, 150.0)
    detections = found((CAR, 0.9, 0), (far, 0.8, 0), ((300.0, 100.0, 400.0, 150.0), 0.7, 0))
    # precision 1 up to a recall of 1/2, then 2/3
    assert precision(truth, [detections])[1] == pytest.approx(0.5 + 0.5 * 2 / 3)


def test_a_second_detection_of_an_object_is_a_false_alarm_and_another_class_is_none() -> None:
    twice = found((CAR, 0.9, 0), (moved(2), 0.95, 0))
    assert precision([[label()]], [twice])[1] == 1.0  # the better one comes first
    truth = [[label(), label((300.0, 100.0, 400.0, 150.0))]]
    rows = [(CAR, 0.9, 0), (moved(2), 0.8, 0), ((300.0, 100.0, 400.0, 150.0), 0.7, 0)]
    assert precision(truth, [found(*rows)])[1] == pytest.approx(0.5 + 0.5 * 2 / 3)
    assert precision(truth, [found(rows[0], (moved(2), 0.8, 1), rows[2])])[1] == 1.0


@pytest.mark.parametrize(
    ("other", "objects"),
    [
        (label((300.0, 100.0, 340.0, 125.0)), {"easy": 1, "moderate": 1, "hard": 1}),  # 25 px: not higher
        (label((300.0, 100.0, 340.0, 126.0)), {"easy": 1, "moderate": 2, "hard": 2}),
        (label((300.0, 100.0, 400.0, 150.0), occlusion=1), {"easy": 1, "moderate": 2, "hard": 2}),
        (label((300.0, 100.0, 400.0, 150.0), occlusion=2), {"easy": 1, "moderate": 1, "hard": 2}),
        (label((300.0, 100.0, 400.0, 150.0), occlusion=3), {"easy": 1, "moderate": 1, "hard": 1}),
        (label((300.0, 100.0, 400.0, 150.0), truncation=0.4), {"easy": 1, "moderate": 1, "hard": 2}),
        (label((300.0, 100.0, 400.0, 150.0), name="DontCare"), {"easy": 1, "moderate": 1, "hard": 1}),
    ],
)
def test_harder_objects_and_regions_count_neither_way(other: ImageLabel, objects: dict[str, int]) -> None:
    for difficulty, count in objects.items():
        detections = [found((CAR, 0.9, 0), (other.edges_px, 0.95, 0))]
        assert precision([[label(), other]], detections, difficulty) == (count, 1.0, 1.0)


def test_low_detections_count_neither_way() -> None:
    low = found((CAR, 0.9, 0), ((300.0, 100.0, 340.0, 120.0), 0.95, 0))
    assert precision([[label()]], [low])[1] == 1.0


def test_without_objects_it_is_not_defined() -> None:
    objects, strict, _ = precision([[]], [found((CAR, 0.9, 0))])
    assert objects == 0
    assert np.isnan(strict)


def test_an_object_that_only_the_clean_picture_shows_is_lost() -> None:
    truth = [PictureTruth.of([label()]), PictureTruth.of([label()])]
    clean = [found((CAR, 0.9, 0)), found((CAR, 0.8, 0))]
    shown = [found((CAR, 0.9, 0)), found((CAR, 0.1, 0))]
    (easy, *_) = picture_scores(truth, clean, shown, ("car",))
    assert easy.clean.is_found.tolist() == [True, True]
    assert easy.shown.is_found.tolist() == [True, False]
    assert 0.1 < easy.min_score <= 0.8


def test_many_pictures_score_as_by_kittis_program() -> None:
    """Which samples the scores: the two differ by a recall position, a fortieth, at most."""
    rng = np.random.default_rng(5)
    truths, detections, known, seen = [], [], [], []
    for _ in range(300):
        corner = rng.uniform(0, 300, (4, 2)) * (1, 0.3) + np.arange(4)[:, None] * (320, 0)
        boxes = np.column_stack([corner, corner + rng.uniform(30, 90, (4, 2))])
        occlusion = rng.integers(0, 3, 4)
        jittered = (boxes + rng.normal(0, 3, boxes.shape))[rng.random(4) < 0.8]
        scores = rng.random(len(jittered))
        truths.append([label(tuple(box), occlusion=int(o)) for box, o in zip(boxes, occlusion, strict=True)])
        detections.append(found(*((tuple(b), s, 0) for b, s in zip(jittered, scores, strict=True))))
        known.append(_kitti(boxes, occlusion))
        seen.append(_kitti(jittered, np.zeros(len(jittered)), scores))
    for each in kitti_precisions(known, seen):
        if (each.class_name, each.space, each.overlaps) == ("Car", "bbox", "official"):
            objects, strict, _ = precision(truths, detections, each.difficulty)
            assert objects == each.objects
            assert strict == pytest.approx(each.r40, abs=0.03)


def _kitti(boxes: np.ndarray, occlusion: np.ndarray, scores: np.ndarray | None = None) -> KittiObjects:
    count = len(boxes)
    return KittiObjects(
        ("Car",) * count, boxes, np.zeros(count), occlusion, np.tile([1.0, 1, 1, 0, 0, 9, 0], (count, 1)),
        np.full(count, -10.0), scores,
    )  # fmt: skip
