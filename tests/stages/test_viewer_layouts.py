"""The layouts of Foxglove and RViz beside every bag that is recorded or attacked."""

from __future__ import annotations

import json
import shutil

import pytest
import yaml

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.viewer_layouts.files import FOXGLOVE, NAMES, RVIZ, layout_texts
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate
from advpipe.stages.verify.run import verify

LIDAR = "sensors.lidars.lidar"
SETTINGS = ["simulation.duration_s=0.3", f"{LIDAR}.channels=8", f"{LIDAR}.points_per_second=20000"]
DETACH = AttackSpec(type="detach", recipe="random", parameters={"ratio": 0.1})
TOUCHED = "/advpipe/debug/ego/lidar/points"


@pytest.fixture(scope="module")
def data_set(tmp_path_factory):
    folder = tmp_path_factory.mktemp("layouts") / "drive"
    simulate(load_scenario("smoke", SETTINGS), folder)
    attack(folder / "clean", folder / "detach", AttackRequest((DETACH,)))
    return folder


def foxglove_scene(bag):
    return json.loads((bag / FOXGLOVE).read_text(encoding="utf-8"))["configById"]["3D!scene"]


def rviz_displays(bag):
    manager = yaml.safe_load((bag / RVIZ).read_text(encoding="utf-8"))["Visualization Manager"]
    return {display["Name"]: display for display in manager["Displays"]}


@pytest.mark.parametrize("name", ["clean", "detach"])
def test_a_layout_shows_topics_of_its_bag_without_a_line_to_the_map(data_set, name):
    bag = data_set / name
    scene, topics = foxglove_scene(bag), BagReader(bag, debug=True).topics
    assert {"/ego/lidar/points", "/ego/markers"} <= scene["topics"].keys() <= topics.keys()
    assert scene["transforms"] == {"frame:map": {"visible": False}}
    assert {"/ego/lidar/points", "/ego/odometry"} <= rviz_displays(bag).keys() <= {*topics, "Grid", "TF"}
    assert (TOUCHED in scene["topics"]) == (TOUCHED in rviz_displays(bag)) == (name == "detach")


def test_touched_points_have_their_own_colours(data_set):
    assert foxglove_scene(data_set / "detach")["topics"][TOUCHED]["colorField"] == "rgb"
    assert rviz_displays(data_set / "detach")[TOUCHED]["Color Transformer"] == "RGB8"


def test_the_layouts_are_the_same_bytes_for_the_same_scenario(data_set, tmp_path):
    simulate(load_scenario("smoke", SETTINGS), tmp_path / "again")
    attack(tmp_path / "again" / "clean", tmp_path / "again" / "detach", AttackRequest((DETACH,)))
    for name in ("clean", "detach"):
        for file in (*NAMES, f"{name}_0.mcap"):
            assert (data_set / name / file).read_bytes() == (tmp_path / "again" / name / file).read_bytes()


def test_overwriting_an_attack_makes_its_layouts_anew(data_set, tmp_path):
    bag = tmp_path / "detach"
    attack(data_set / "clean", bag, AttackRequest((DETACH,)))
    attack(data_set / "clean", bag, AttackRequest((DETACH,), debug=False), overwrite=True)
    assert {name: (bag / name).read_text(encoding="utf-8") for name in NAMES} == layout_texts(bag)
    assert TOUCHED not in foxglove_scene(bag)["topics"]


def test_verify_knows_them_and_says_when_one_is_another(data_set, tmp_path):
    copy = shutil.copytree(data_set, tmp_path / "copy")
    assert not [one for one in verify(copy).unchecked if one.where.endswith(NAMES)]
    (copy / "clean" / FOXGLOVE).write_text("{}", encoding="utf-8")
    (copy / "detach" / RVIZ).unlink()  # as in a data set of an older release
    result = verify(copy)
    assert result.is_good
    assert [one.where for one in result.unchecked if one.where.endswith(NAMES)] == [f"clean/{FOXGLOVE}"]
