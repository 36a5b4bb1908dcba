"""KITTI's rules, against figures of OpenPCDet's port of the official program and against counts by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kitti_frames import synthetic_frames

from advpipe.pipeline.metrics.kitti import KittiPrecision, kitti_precisions, score_thresholds
from advpipe.pipeline.metrics.kitti_objects import DONT_CARE, KittiObjects

CAR_BOX = (1.5, 1.6, 4.0, 0.0, 1.7, 20.0, 0.0)

Row = tuple[str, float]


def objects(
    *rows: Row, x_m: float = 10.0, height_px: float = 60.0, occluded: float = 0.0, scored: bool = False
) -> KittiObjects:
    """Objects side by side, one each `x_m`: a type, and a score or a truncation."""
    count = len(rows)
    left = 100.0 * np.arange(count)
    boxes = np.tile(CAR_BOX, (count, 1)).reshape(-1, 7)
    boxes[:, 3] += x_m * np.arange(count)
    values = np.array([value for _, value in rows], dtype=float)
    return KittiObjects(
        tuple(name for name, _ in rows),
        np.column_stack([left, np.zeros(count), left + 50, np.full(count, height_px)]),
        np.zeros(count) if scored else values,
        np.full(count, occluded),
        boxes,
        np.zeros(count),
        values if scored else None,
    )


def precision(found: tuple[KittiPrecision, ...], space: str, difficulty: str = "easy") -> KittiPrecision:
    (one,) = (
        each
        for each in found
        if (each.class_name, each.space, each.difficulty, each.overlaps)
        == ("Car", space, difficulty, "official")
    )
    return one


def test_all_figures_are_those_of_the_official_program() -> None:
    found = kitti_precisions(*synthetic_frames(150, seed=1))
    figures = {(one.class_name, one.difficulty, one.overlaps, one.space): one for one in found}
    heads, *lines = (Path(__file__).parent / "kitti_official.txt").read_text(encoding="utf-8").splitlines()
    assert len(lines) * 4 == len(found) == 72
    for line in lines:
        *key, text = line.split(maxsplit=3)
        for head, expected in zip(heads.split()[3:], text.split(), strict=True):
            space, positions = head.split("_")
            percent = 100 * getattr(figures[(*key, space)], positions)
            assert percent == pytest.approx(float(expected), abs=1e-6), (*key, head)


def test_every_object_found_makes_one() -> None:
    """40 objects in each of 2 frames: the thresholds reach recall 1."""
    truth = objects(*[("Car", 0.0)] * 40)
    scores = np.linspace(0.9, 0.1, 40)
    found = objects(*[("Car", score) for score in scores], scored=True)
    for space in ("bbox", "bev", "3d", "aos"):
        one = precision(kitti_precisions([truth] * 2, [found] * 2), space)
        assert (one.r11, one.r40, one.objects) == (1.0, 1.0, 80)


def test_half_of_the_objects_found_make_half() -> None:
    truth = objects(*[("Car", 0.0)] * 40)
    found = objects(*[("Car", 0.9 - 0.01 * place) for place in range(20)], scored=True)
    one = precision(kitti_precisions([truth], [found]), "3d")
    # Thresholds at recalls 1/40 to 20/40: positions 0 to 19 of 41, so 19 of the last 40 and 5 of the 11.
    assert (one.r40, one.r11) == (19 / 40, 5 / 11)


def test_few_objects_never_reach_one() -> None:
    """A known property of the program: 3 objects give 3 thresholds of 41."""
    three = [("Car", 0.9), ("Car", 0.8), ("Car", 0.7)]
    one = precision(kitti_precisions([objects(*[("Car", 0.0)] * 3)], [objects(*three, scored=True)]), "3d")
    assert (one.r40, one.r11) == (2 / 40, 1 / 11)


def test_objects_and_detections_that_count_neither_way() -> None:
    """A van, an occluded and a truncated car are no misses, and what finds them is not false."""
    truth = objects(("Car", 0.0), ("Van", 0.0), ("Car", 0.4))
    found = objects(("Car", 0.9), ("Car", 0.95), ("Car", 0.95), scored=True)
    easy = precision(kitti_precisions([truth], [found]), "3d")
    assert (easy.objects, easy.r11) == (1, 1 / 11)
    hard = precision(kitti_precisions([truth], [found]), "3d", "hard")
    assert hard.objects == 2
    occluded = objects(("Car", 0.0), occluded=1.0)
    found_one = objects(("Car", 0.9), scored=True)
    numbers = [
        precision(kitti_precisions([occluded], [found_one]), "3d", difficulty).objects
        for difficulty in ("easy", "moderate", "hard")
    ]
    assert numbers == [0, 1, 1]


def test_a_low_detection_counts_neither_way_at_a_difficulty() -> None:
    truth, low = objects(("Car", 0.0)), objects(("Car", 0.9), ("Car", 0.99), scored=True)
    low = KittiObjects(low.names, low.bbox_px * (1, 1, 1, 0.5), low.truncated, low.occluded, low.boxes,
                       low.alpha_rad, low.scores)  # fmt: skip
    assert precision(kitti_precisions([truth], [low]), "3d").r11 == 0
    # At 30 pixels it counts as moderate, and the second one is false.
    assert precision(kitti_precisions([truth], [low]), "3d", "moderate").r11 == pytest.approx(0.5 / 11)


def test_a_detection_in_a_region_is_not_false_in_the_image_alone() -> None:
    region = objects(("Car", 0.0), (DONT_CARE, -1.0))
    found = objects(("Car", 0.5), ("Car", 0.9), scored=True)
    precisions = kitti_precisions([region], [found])
    assert precision(precisions, "bbox").r11 == pytest.approx(1 / 11)
    assert precision(precisions, "3d").r11 == pytest.approx(0.5 / 11)


def test_orientation_is_left_out_where_it_is_unknown() -> None:
    found = objects(("Car", 0.5), scored=True)
    unknown = KittiObjects(found.names, found.bbox_px, found.truncated, found.occluded, found.boxes,
                           np.array([-10.0]), found.scores)  # fmt: skip
    precisions = kitti_precisions([objects(("Car", 0.0))], [unknown])
    assert {one.space for one in precisions} == {"bbox", "bev", "3d"}


def test_without_objects_the_value_is_the_programs_zero() -> None:
    one = precision(kitti_precisions([objects()], [objects(scored=True)]), "3d")
    assert (one.objects, one.r11, one.r40) == (0, 0.0, 0.0)


def test_thresholds_take_the_nearer_recall() -> None:
    # 4 of 8 objects: recalls 1/8 to 4/8 are farther apart than 1/40, so each score is a threshold.
    assert score_thresholds(np.array([0.2, 0.9, 0.5, 0.4]), 8).tolist() == [0.9, 0.5, 0.4, 0.2]
    # 80 of 80: the first, and then every second one.
    taken = score_thresholds(np.linspace(1, 0, 80), 80)
    assert len(taken) == 41


def test_wrong_input() -> None:
    one = objects(("Car", 0.0))
    with pytest.raises(ValueError, match="1 frames of truth, but 0"):
        kitti_precisions([one], [])
    with pytest.raises(ValueError, match="without scores"):
        kitti_precisions([one], [one])
    with pytest.raises(ValueError, match="bbox_px has shape"):
        KittiObjects(("Car",), np.zeros((1, 3)), np.zeros(1), np.zeros(1), np.zeros((1, 7)), np.zeros(1))
    with pytest.raises(ValueError, match="not finite"):
        objects(("Car", np.nan), scored=True)
