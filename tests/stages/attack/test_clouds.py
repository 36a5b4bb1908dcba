"""Which clouds are attacked when: six frames at 10 Hz, and two LiDARs."""

from __future__ import annotations

import re

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.run import AttackRequest, attack

DETECTOR = "linear_detector:Shipped"
ROOF = VehicleTopics("ego", "roof").lidar_points


def detach(ratio=0.1, recipe="random", **keys):
    return AttackSpec(type="detach", recipe=recipe, parameters={"ratio": ratio}, detector=DETECTOR, **keys)


def rows(folder):
    return pq.read_table(str(folder / "frames.parquet")).to_pylist()


@pytest.fixture
def two_lidars(clean_bag, tmp_path):
    """The drive with clouds of 40 points of a second LiDAR, at half the rate."""
    path = tmp_path / "two"
    reader = BagReader(clean_bag)
    with BagWriter(path, provenance=reader.provenance) as bag:
        clouds = 0
        for raw in reader.raw_messages():
            bag.copy(raw)
            if raw.topic.name == "/ego/lidar/points":
                if clouds % 2 == 0:
                    cloud = np.zeros(40, POINT_DTYPE)
                    cloud["x"] = np.arange(40) + clouds
                    cdr = cloud_to_cdr(cloud, raw.log_time_ns, "ego/lidar")
                    bag.write_cdr(ROOF, cdr, raw.log_time_ns)
                clouds += 1
    return path


def test_clouds_outside_the_schedule_stay_as_they_are(clean_bag, tmp_path):
    spec = detach(schedule=Schedule(from_s=0.1, to_s=0.3))
    attack(clean_bag, tmp_path / "adv", AttackRequest((spec,)))
    found = rows(tmp_path / "adv")
    assert [row["attack"] for row in found] == ["", "detach", "detach", "", "", ""]
    assert [row["points_adversarial"] for row in found] == [500, 451, 452, 503, 504, 505]
    assert found[0]["note"] == "not scheduled"
    clean, adversarial = (
        list(BagReader(bag).raw_messages(["/ego/lidar/points"])) for bag in (clean_bag, tmp_path / "adv")
    )
    assert [a == b for a, b in zip(clean, adversarial, strict=True)] == [True, False, False, True, True, True]


def test_chance_does_not_hang_on_the_chosen_frames(clean_bag, tmp_path):
    spec = detach(schedule=Schedule(kind="random", probability=0.5))
    attack(clean_bag, tmp_path / "all", AttackRequest((spec,), 3))
    attacked_frames = [row["frame"] for row in rows(tmp_path / "all") if row["attack"]]
    assert 0 < len(attacked_frames) < 6
    some = spec.model_copy(update={"frames": "1:"})
    attack(clean_bag, tmp_path / "some", AttackRequest((some,), 3))
    assert [row["frame"] for row in rows(tmp_path / "some") if row["attack"]] == [
        k for k in attacked_frames if k
    ]


def test_one_after_the_other(clean_bag, tmp_path):
    early, late = detach(0.1, schedule=Schedule(to_s=0.3)), detach(0.2, schedule=Schedule(from_s=0.3))
    attack(clean_bag, tmp_path / "adv", AttackRequest((early, late)))
    assert [row["points_adversarial"] for row in rows(tmp_path / "adv")] == [450, 451, 452, 402, 403, 404]
    resolved = yaml.safe_load((tmp_path / "adv" / "attack.yaml").read_text())
    assert [one["parameters"]["ratio"] for one in resolved["attacks"]] == [0.1, 0.2]
    assert resolved["attack"] == "detach+detach"
    assert resolved["parameters"] == {}  # no single budget


def test_both_lidars(two_lidars, tmp_path):
    specs = (detach(frames="0:4"), detach(0.25, lidar=ROOF.name, frames="0:4"))
    attack(two_lidars, tmp_path / "adv", AttackRequest(specs))
    found = [(row["topic"], row["frame"], row["points_adversarial"]) for row in rows(tmp_path / "adv")]
    main = [("/ego/lidar/points", frame, points) for frame, points in enumerate([450, 451, 452, 453])]
    assert sorted(found) == [*main, (ROOF.name, 0, 30), (ROOF.name, 1, 30)]
    labels = pq.read_table(str(tmp_path / "adv" / "labels.parquet")).to_pylist()
    removed = {row["point"] for row in labels if row["topic"] == ROOF.name and row["frame"] == 1}
    roof = list(read_frames(tmp_path / "adv", lidar_topic=ROOF.name))
    assert {int(x) - 2 for x in roof[1].cloud["x"]} == set(range(40)) - removed  # its x counts from 2 on


def test_the_default_lidar_is_said_where_there_are_others(two_lidars, tmp_path, capsys):
    attack(two_lidars, tmp_path / "adv", AttackRequest((detach(frames="0:1"),)))
    assert "two has 2 LiDARs; /ego/lidar/points is used by default" in capsys.readouterr().err
    attack(two_lidars, tmp_path / "roof", AttackRequest((detach(lidar=ROOF.name, frames="0:1"),)))
    assert "LiDARs" not in capsys.readouterr().err


def test_the_victims_lidar_is_found(two_lidars, tmp_path):
    attack(two_lidars, tmp_path / "adv", AttackRequest((detach(victim="ego"),)))
    assert {row["topic"] for row in rows(tmp_path / "adv")} == {"/ego/lidar/points"}


@pytest.mark.parametrize(
    ("specs", "line"),
    [
        (
            [detach(), detach(0.2)],
            "detach and detach attack the same clouds of /ego/lidar/points",
        ),
        ([detach(frames="0:2"), detach(frames="3:")], "one bag cannot hold both 0:2 and 3:"),
        ([detach(schedule=Schedule(from_s=0.6))], r"begins at 0.6 s, but the recording ends at 0.58 s"),
        (
            [detach(schedule=Schedule(from_s=0.5), frames="0:3")],
            "schedule, from 0.5 s, meets none of the 3 chosen clouds of /ego/lidar/points; those are at 0",
        ),
        ([detach(victim="bob")], "has no clouds of the victim 'bob'; vehicles with clouds: ego"),
        ([detach(victim="eg")], r"victim 'eg'; did you mean 'ego'\?"),
        ([detach(lidar="/x/points")], "has no clouds on /x/points; it has /ego/lidar/points"),
        ([], "no attack is given"),
    ],
)
def test_what_cannot_be_done_is_refused(clean_bag, tmp_path, specs, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        attack(clean_bag, tmp_path / "adv", AttackRequest(tuple(specs)))
    assert "\n" not in str(caught.value)
    assert [item.name for item in tmp_path.iterdir()] == ["clean"]


@pytest.fixture
def without_truth(clean_bag, tmp_path):
    path = tmp_path / "bare"
    with BagWriter(path, provenance={}) as bag:
        for raw in BagReader(clean_bag).raw_messages():
            if raw.topic.name != "/ego/ground_truth/objects":
                bag.copy(raw)
    return path


@pytest.mark.parametrize("recipe", ["best", "paper", "random-near"])
def test_a_bag_without_the_truth_that_a_recipe_needs_is_refused(without_truth, tmp_path, recipe):
    line = (
        r"bare has no ground truth \(no topic of vision_msgs/msg/Detection3DArray or .*\); detach attacks "
        "the objects in it: give a bag that holds it, or take the recipe random"
    )
    with pytest.raises(UsageError, match=line):
        attack(without_truth, tmp_path / "adv", AttackRequest((detach(recipe=recipe),)))
    assert not (tmp_path / "adv").exists()


def test_recipes_that_need_no_truth_do_without(without_truth, tmp_path):
    summary = attack(without_truth, tmp_path / "adv", AttackRequest((detach(recipe="random"),)))
    assert (summary.frames, summary.unchanged, summary.warnings) == (6, 0, [])
    ghost = AttackSpec(type="attach", parameters={"points": 5, "eps_m": 1.0, "ghost": "car:5:5"})
    assert not build_lidar_attack(ghost).needs_ground_truth


def test_frames_without_an_object_are_a_success_with_a_warning(clean_bag, tmp_path, capsys):
    summary = attack(clean_bag, tmp_path / "adv", AttackRequest((detach(recipe="best", frames="4:5"),)))
    (warning,) = summary.warnings
    assert re.search(r"no cloud of .*adv was changed: no object to hide .* \(1 of 1 frame\)", warning)
    assert f"warning: {warning}\n" in capsys.readouterr().err
