"""Detections of a report beside the bag: the same as in the report's own viewer, and of these clouds only."""

import json
import re
import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "evaluate"))

from place_drive import DETECTOR, clean_cloud, hide_first_car, write_bag

from advpipe.commands.evaluate import evaluate
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.viewer.encoding import encode_scene
from advpipe.stages.view.run import open_scenes


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """A data set with one attack and its report."""
    path = tmp_path_factory.mktemp("evaluated") / "set"
    path.mkdir()
    clean = write_bag(path / "clean", {"kind": "clean"}, {index: clean_cloud(index) for index in range(8)})
    about = {"kind": "attack", "attack": "detach", "recipe": "best", "parent_sha256": parent_sha256(clean)}
    parameters = {"parameters": json.dumps({"ratio": 0.014, "rounds": 10})}
    clouds = {index: hide_first_car(clean_cloud(index)) for index in range(6)}
    write_bag(path / "detach", about | parameters, clouds)
    evaluate(clean, path / "detach", out=path / "reports" / "place", detector=DETECTOR, workers=1)
    return path


@pytest.fixture
def dataset(evaluated, tmp_path):
    return Path(shutil.copytree(evaluated, tmp_path / "set"))


def described(scene):
    """What is said of each object and prediction, but for facts that only the report knows."""
    return sorted(
        (box["role"], box["outcome"], box["condition"], box["title"], box["lead"], box["box"])
        for box in scene["boxes"]
        if "not evaluated" not in box["lead"].lower()
    )


def test_they_are_those_of_the_reports_viewer(dataset):
    text = (dataset / "reports" / "place" / "report.html").read_text()
    found = re.findall(r'<script type="application/json" class="adv-scene"[^>]*>(.*?)</script>', text)
    scenes, known = open_scenes(dataset), [json.loads(each) for each in found]
    assert len(known) == 3
    for scene in known:
        index = int(scene["name"].rpartition("-")[2])
        shown = json.loads(encode_scene(scenes.scene(index, 0)))
        ignored = [box for box in shown["boxes"] if box["outcome"] == "ignored"]
        assert {box["id"] for box in ignored} == {"user4", "user5"}
        shown["boxes"] = [box for box in shown["boxes"] if box not in ignored]
        assert described(shown) == described(scene)
        assert "reports/place" in shown["note"]


def test_the_clean_bag_alone_has_its_own(dataset):
    scene = open_scenes(dataset).scene(2, None)
    predictions = [box for box in scene.boxes if box.role == "prediction"]
    assert {box.condition for box in predictions} == {""}
    assert len(predictions) == 4


def test_scores_on_both_clouds(dataset):
    scene = open_scenes(dataset).scene(2, 0)
    (lost,) = (box for box in scene.boxes if box.outcome == "lost")
    (score,) = (fact for fact in lost.facts if fact.name == "score")
    assert (score.value, score.attacked) == ("0.60", "no box")


def test_a_frame_without_an_adversarial_cloud(dataset):
    scene = open_scenes(dataset).scene(7, 0)
    assert not [box for box in scene.boxes if box.role == "prediction" and box.condition == "attacked"]


def test_those_of_other_clouds_are_not_shown(dataset):
    """The attack was made anew after the report."""
    shutil.rmtree(dataset / "detach")
    about = {"kind": "attack", "attack": "detach", "parent_sha256": parent_sha256(dataset / "clean")}
    write_bag(dataset / "detach", about, {index: clean_cloud(index)[80:] for index in range(6)})
    scene = open_scenes(dataset).scene(2, 0)
    assert {box.role for box in scene.boxes} == {"truth"}
    assert {box.outcome for box in scene.boxes} == {""}


def test_a_damaged_report_leaves_the_frame(dataset):
    table = dataset / "reports" / "place" / "results.parquet"
    table.write_bytes(table.read_bytes()[:-100])
    scene = open_scenes(dataset).scene(2, 0)
    assert {box.role for box in scene.boxes} == {"truth"}
    assert scene.note.startswith("No detections: ")
    (dataset / "reports" / "place" / "report.json").write_text("{")
    assert open_scenes(dataset).scene(2, 0).note == ""
    with pytest.raises(AdvpipeError, match="not a report"):
        open_scenes(dataset, report=dataset / "reports" / "place")


def test_a_chosen_report(dataset):
    moved = shutil.move(dataset / "reports" / "place", dataset.parent / "elsewhere")
    assert open_scenes(dataset).scene(2, 0).note == ""
    scene = open_scenes(dataset, report=Path(moved)).scene(2, 0)
    assert sum(box.role == "prediction" for box in scene.boxes) == 7
