"""A scene goes through its text and back, as the page reads it, and is never larger than it may be."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest
from scenes import LOST_CAR, cloud, moving_scene, removing_scene

from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.viewer.encoding import FORMAT, LIMIT_BYTES, MOST_BOXES, encode_scene
from advpipe.pipeline.viewer.scene import SceneBox, SceneLine, ViewerScene


def decoded(scene, **options):
    """What a page has of a scene, its points by what became of them, read as the docstrings say."""
    frame = json.loads(encode_scene(scene, **options))
    packed = frame["points"]
    places = metres(packed["xyz"], packed["unit_m"])
    ends = np.cumsum(packed["counts"])[:-1]
    names = ("kept", "moved", "removed", "added")
    return frame, {
        **dict(zip(names, np.split(places, ends), strict=True)),
        "way": metres(packed["offset"], packed["offset_unit_m"]),
        "intensity": np.frombuffer(base64.b64decode(packed["intensity"]), np.uint8) / 255,
    }


def metres(text, unit_m):
    return np.frombuffer(base64.b64decode(text), "<i2").reshape(-1, 3) * unit_m


def test_removed_and_added_points_come_back():
    scene = removing_scene()
    frame, points = decoded(scene)
    assert frame["format"] == FORMAT
    assert frame["is_attacked"]
    change = scene.difference
    assert frame["points"]["counts"] == frame["points"]["total"]
    assert frame["points"]["counts"] == [3000 - len(change.removed), 0, len(change.removed), 25]
    step_m = 30 / 32767
    np.testing.assert_allclose(points["removed"], xyz(scene.clean)[change.removed], atol=step_m)
    np.testing.assert_allclose(points["added"], xyz(scene.attacked)[-25:], atol=step_m)
    kept = np.delete(scene.clean, change.removed)
    np.testing.assert_allclose(points["kept"], xyz(kept), atol=step_m)
    np.testing.assert_allclose(points["intensity"][: len(kept)], kept["intensity"], atol=0.5 / 255 + 1e-6)


def test_small_displacements_are_kept_finely():
    scene = moving_scene()
    frame, points = decoded(scene)
    assert frame["points"]["counts"] == [2699, 301, 0, 0]  # 300 moved, and one reflects otherwise
    moved = points["moved"]
    lengths_m = np.linalg.norm(points["way"], axis=1)
    assert np.sum(lengths_m == 0) == 1
    np.testing.assert_allclose(lengths_m[lengths_m > 0], np.hypot(0.04, 0.02), atol=1e-5)
    np.testing.assert_allclose(moved[:2], xyz(scene.clean)[[0, 5]], atol=30 / 32767)


def test_a_clean_frame_alone():
    frame, points = decoded(ViewerScene("clean-000000", "frame 0", cloud()))
    assert not frame["is_attacked"]
    assert frame["points"]["counts"] == [3000, 0, 0, 0]
    assert len(points["way"]) == 0
    assert frame["ground_z_m"] == pytest.approx(-1.7, abs=0.1)


def test_stories_come_with_their_boxes():
    frame, _ = decoded(removing_scene())
    box = next(box for box in frame["boxes"] if box["title"] == LOST_CAR.title)
    assert (box["role"], box["outcome"], box["id"], box["condition"]) == ("truth", "lost", "ego.7", "")
    assert box["facts"] == [["range", "12.4 m"], ["score", "0.83", "0.21"], ["LiDAR points", "143", "97"]]
    assert box["box"] == list(LOST_CAR.box)


def test_points_without_numbers_and_far_ones_are_left_out():
    clean = cloud()
    clean["x"][:4] = [np.nan, np.inf, 1e6, -301]
    frame, points = decoded(ViewerScene("a", "a", clean))
    assert frame["points"]["counts"][0] == 2996
    assert frame["points"]["total"][0] == 3000
    assert np.abs(points["kept"]).max() <= 30.001
    assert "2,996 of 3,000" in frame["note"]


def test_boxes_and_places_without_numbers_are_left_out():
    boxes = (LOST_CAR, replace(LOST_CAR, box=(1, 2, np.nan, 4, 2, 1, 0)))
    line = SceneLine("lane", np.array([[0, 0, 0], [1, 0, np.inf], [2, 0, 0], [3, 0, 0]], float))
    frame, _ = decoded(ViewerScene("a", "a", cloud(), boxes=boxes, lines=(line,)))
    assert len(frame["boxes"]) == 1
    (part,) = frame["lines"]
    np.testing.assert_allclose(metres(part["xyz"], part["unit_m"]), [[2, 0, 0], [3, 0, 0]], atol=1e-3)


def test_intensities_of_another_scale():
    clean = cloud()
    clean["intensity"] = np.linspace(0, 255, len(clean))
    _, points = decoded(ViewerScene("a", "a", clean))
    assert points["intensity"].max() == 1
    assert points["intensity"].mean() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("attack", ["none", "move", "remove", "add"])
def test_no_frame_is_larger_than_it_may_be(attack):
    """Of the largest LiDAR, wherever an attack touches all of its points."""
    clean = cloud(280_000)
    attacked = None if attack == "none" else clean.copy()
    if attack == "move":
        attacked["x"] += 0.1
    elif attack == "remove":
        attacked = attacked[:5]
    elif attack == "add":
        attacked = np.concatenate([attacked, cloud(280_000, seed=3)])
    scene = ViewerScene("a", "a", clean, attacked, boxes=(LOST_CAR,) * 200)
    text = encode_scene(scene)
    assert 0.6 * LIMIT_BYTES < len(text) <= LIMIT_BYTES
    frame, _ = decoded(scene)
    counts, total = frame["points"]["counts"], frame["points"]["total"]
    assert sum(counts) < sum(total)
    assert all((shown > 0) == (there > 0) for shown, there in zip(counts, total, strict=True))
    assert f"{sum(counts):,} of {sum(total):,}" in frame["note"]


def test_few_touched_points_are_all_shown():
    clean = cloud(280_000)
    scene = ViewerScene("a", "a", clean, clean[100:])
    frame, points = decoded(scene)
    assert frame["points"]["counts"][2] == 100
    assert len(points["removed"]) == 100


def test_any_number_of_boxes_and_lines():
    rng = np.random.default_rng(0)
    boxes = tuple(
        SceneBox("truth", (*place, 0, 4, 2, 1, 0), "x" * 5000) for place in rng.uniform(-200, 200, (4000, 2))
    )
    lines = tuple(SceneLine("lane", rng.uniform(-300, 300, (500, 3))) for _ in range(400))
    scene = ViewerScene("a", "a" * 9000, cloud(), boxes=boxes, lines=lines)
    text = encode_scene(scene)
    assert len(text) <= LIMIT_BYTES
    shown = json.loads(text)["boxes"]
    assert len(shown) == MOST_BOXES
    assert max(np.hypot(*box["box"][:2]) for box in shown) < 120  # the nearest ones


def test_texts_of_bags_end_no_script():
    box = replace(LOST_CAR, title="</script><script>alert(1)</script>\x1b[31m")
    text = encode_scene(replace(removing_scene(), boxes=(box,), title="</SCRIPT>"))
    assert "<" not in text
    assert "\x1b" not in text
    assert text.isascii()


def test_same_scene_same_text():
    assert encode_scene(removing_scene()) == encode_scene(removing_scene())
