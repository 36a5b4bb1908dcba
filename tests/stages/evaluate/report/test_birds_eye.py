"""The bird's-eye picture: what is in it can be found again by its colour and place."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.pipeline.messages.cloud_difference import cloud_difference
from advpipe.stages.evaluate.detection.scoring import Truth
from advpipe.stages.evaluate.report.birds_eye import DISPLACED, LOST, PREDICTION, TRUTH, draw_scene, legend
from advpipe.stages.evaluate.report.pictures import to_png
from advpipe.stages.evaluate.report.scene import CloudView, ReportScene, crop

BOXES = np.array([[12.0, 6.0, 0.0, 4.5, 2.0, 1.5, 0.4], [20.0, -8.0, 0.0, 4.5, 2.0, 1.5, 0.0]])


def cloud() -> np.ndarray:
    rng = np.random.default_rng(0)
    points = np.zeros(2000, POINT_DTYPE)
    points["x"], points["y"], points["z"] = rng.uniform(-30, 30, (2, 2000)).tolist() + [
        rng.uniform(-2, 1, 2000)
    ]
    return points


def scene(lost=(False, False), after_boxes=BOXES, attacked=True) -> ReportScene:
    boxes = Boxes(BOXES, np.zeros(2, np.int64), ("a", "b"), np.zeros((2, 3)))
    truth = Truth(boxes, np.array([True, True]), np.array([True, True]), np.array([90, 40]), np.zeros(2))
    after = CloudView(cloud()[50:], after_boxes)
    change = cloud_difference(cloud(), after.cloud)
    before = CloudView(cloud(), BOXES)
    if not attacked:
        return ReportScene("title", "name", truth, np.array(lost), before, None, None)
    return ReportScene("title", "name", truth, np.array(lost), before, after, change)


def pixels(picture: np.ndarray, colour: str) -> int:
    return int((np.abs(picture[..., :3] - to_rgb(colour)).max(axis=-1) < 0.25).sum())


def drawn(of: ReportScene) -> np.ndarray:
    return imread(io.BytesIO(to_png(draw_scene(of))))


def test_same_scene_same_bytes():
    assert to_png(draw_scene(scene())) == to_png(draw_scene(scene()))


def test_truth_is_blue_and_predictions_are_red():
    picture = drawn(scene())
    assert pixels(picture, TRUTH) > 200
    assert pixels(picture, PREDICTION) > 200


def test_a_missing_prediction_is_less_red():
    both, one = (pixels(drawn(scene(after_boxes=boxes)), PREDICTION) for boxes in (BOXES, BOXES[:1]))
    assert one < both - 100


def test_a_lost_object_is_marked_in_orange_after_the_attack():
    without, lost = drawn(scene()), drawn(scene((True, False), after_boxes=BOXES[1:]))
    assert pixels(lost, LOST) > pixels(without, LOST) + 200


def test_a_displaced_object_has_a_colour_of_its_own_and_its_score_beside_it():
    plain = scene()
    displaced = replace(plain, displaced=np.array([False, True]), marks={1: "0.42, IoU 0.58"})
    assert pixels(drawn(displaced), DISPLACED) > pixels(drawn(plain), DISPLACED) + 200
    texts = [text.get_text() for axes in draw_scene(displaced).axes for text in axes.texts]
    assert "0.42, IoU 0.58" in texts


def test_the_legend_says_from_which_score_on_an_object_is_found():
    lost = replace(scene((True, False)), min_score=0.2)
    labels = [entry.get_label() for entry in legend(lost)]
    assert labels[-1] == "lost: no box with score ≥ 0.20 at loose overlap"
    assert not any(label.startswith("displaced") for label in labels)


def test_a_clean_scene_has_one_panel():
    picture = drawn(scene(attacked=False))
    assert pixels(picture, TRUTH) > 100


def test_a_frame_without_anything():
    nothing = Truth(Boxes(), np.zeros(0, bool), np.zeros(0, bool), np.zeros(0, np.int64), np.zeros(0))
    empty = CloudView(np.zeros(0, POINT_DTYPE), np.zeros((0, 7)))
    blank = ReportScene(
        "nothing", "n", nothing, np.zeros(0, bool), empty, empty, cloud_difference(empty.cloud, empty.cloud)
    )
    assert drawn(blank).shape[0] > 400


def test_crop_holds_boxes_and_the_sensor():
    assert crop([BOXES], margin_m=8.0, least_m=10.0) == (-8.0, 28.0, -16.0, 14.0)
    assert crop([BOXES[:0]], margin_m=8.0, least_m=50.0) == (-25.0, 25.0, -25.0, 25.0)


@pytest.mark.parametrize("lost", [(True, True), (False, True)])
def test_from_near_shows_the_nearest_lost_object(lost):
    figure = draw_scene(scene(lost))
    near = figure.axes[-1]
    x, y = BOXES[0 if lost[0] else 1, :2]
    assert near.get_ylim() == (x - 6, x + 6)
    assert near.get_xlim() == (y + 6, y - 6)  # left is left
