from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path

import linear_detector
import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
import yaml

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.code import code_sha256
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.detector.checkpoint import save_checkpoint
from advpipe.pipeline.detector.second.model import SecondNet
from advpipe.pipeline.detector.second.presets import SMALL
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import cloud_from_cdr
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack import provenance
from advpipe.stages.attack.run import AttackRequest, attack

LIDAR = "/ego/lidar/points"
DETECTOR = "linear_detector:Shipped"
INTERRUPTED = "linear_detector:Interrupted"


def request(**changes):
    given = {"type": "detach", "parameters": {"ratio": 0.1}, "detector": DETECTOR, "seed": 3, **changes}
    seed = given.pop("seed")
    return AttackRequest((AttackSpec(**given),), seed)


def files_of(folder):
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


def table(file):
    """The columns of a Parquet file by name, as numpy arrays."""
    columns = pq.read_table(str(file))
    return {name: columns[name].to_numpy() for name in columns.column_names}


def raw_by_topic(bag):
    found = {}
    for raw in BagReader(bag).raw_messages():
        found.setdefault(raw.topic.name, []).append(raw)
    return found


@pytest.fixture(autouse=True)
def _counted_from_zero():
    linear_detector.Shipped.gradients = 0


@pytest.mark.parametrize("recipe", ["best", "paper", "random"])
def test_labels_are_the_difference_between_the_bags(clean_bag, tmp_path, recipe):
    attack(clean_bag, tmp_path / "adv", request(recipe=recipe))
    labels = table(tmp_path / "adv" / "labels.parquet")
    clean, adversarial = list(read_frames(clean_bag)), list(read_frames(tmp_path / "adv"))
    assert len(clean) == len(adversarial) == 6
    for before, after in zip(clean, adversarial, strict=True):
        mine = labels["frame"] == before.index
        assert (labels["stamp_ns"][mine] == before.stamp_ns).all()
        assert (labels["action"][mine] == "removed").all()
        assert np.delete(before.cloud, labels["point"][mine]).tobytes() == after.cloud.tobytes()
        untouched = before.index == 4 and recipe != "random"
        assert mine.sum() == (0 if untouched else 50 + (before.index >= 5))  # round(0.1 * (500 + index))
        assert after.stamp_ns == before.stamp_ns
        np.testing.assert_array_equal(after.boxes.geometry, before.boxes.geometry)


def test_frames_table_and_summary(clean_bag, tmp_path):
    summary = attack(clean_bag, tmp_path / "adv", request())
    frames = table(tmp_path / "adv" / "frames.parquet")
    assert frames["frame"].tolist() == [0, 1, 2, 3, 4, 5]
    assert frames["points_clean"].tolist() == [500, 501, 502, 503, 504, 505]
    assert frames["points_adversarial"].tolist() == [450, 451, 452, 453, 504, 454]
    with_car = frames["frame"] != 4
    assert (frames["loss_after"] > frames["loss_before"] + 1)[with_car].all()
    assert frames["note"][4] == "no object to hide that the detector could find"
    assert (summary.frames, summary.unchanged) == (6, 1)
    assert (summary.points_clean, summary.points_adversarial) == (3015, 2764)
    assert summary.notes == {frames["note"][4]: 1}
    assert "1 of 6 frames: no object" in str(summary)


def test_untouched_topics_are_copied_byte_for_byte(clean_bag, tmp_path):
    attack(clean_bag, tmp_path / "adv", request())
    clean, adversarial = raw_by_topic(clean_bag), raw_by_topic(tmp_path / "adv")
    assert list(clean) == list(adversarial)
    for topic in clean:
        if topic != LIDAR:
            assert clean[topic] == adversarial[topic]
    for before, after in zip(clean[LIDAR], adversarial[LIDAR], strict=True):
        assert (before.log_time_ns, before.sequence, before.topic) == (
            after.log_time_ns,
            after.sequence,
            after.topic,
        )
        assert cloud_from_cdr(before.cdr).frame_id == cloud_from_cdr(after.cdr).frame_id
    assert clean[LIDAR][4] == adversarial[LIDAR][4]  # the frame without an object


def test_provenance_and_resolved_request(clean_bag, tmp_path):
    attack(clean_bag, tmp_path / "adv", request())
    record = BagReader(tmp_path / "adv").provenance
    assert record["kind"] == "attack"
    assert record["scenario"] == BagReader(clean_bag).provenance["scenario"]
    assert record["parent_sha256"] == parent_sha256(clean_bag)
    resolved = yaml.safe_load((tmp_path / "adv" / "attack.yaml").read_text())
    assert resolved["attack"] == "detach"
    assert {"ratio": 0.1, "rounds": 10}.items() <= resolved["parameters"].items()
    assert resolved["budget"] == "ratio"
    assert resolved["detector"] == DETECTOR
    assert resolved["code_sha256"] == record["code_sha256"] == code_sha256(*provenance.LIDAR)
    assert resolved["lidar_topics"] == [LIDAR]
    assert resolved["looks"] == 13


def test_frames_that_other_code_made_are_done_anew(clean_bag, tmp_path, monkeypatch):
    interrupted = request(detector="linear_detector:Interrupted")
    with pytest.raises(KeyboardInterrupt):
        attack(clean_bag, tmp_path / "adv", interrupted)
    (before,) = tmp_path.glob(".adv.*.job")
    monkeypatch.setattr(provenance, "code_sha256", lambda *parts: "7" * 64)
    linear_detector.Shipped.gradients = 30  # past the one that interrupts
    attack(clean_bag, tmp_path / "adv", interrupted)
    assert linear_detector.Shipped.gradients == 30 + 50  # of all five frames with an object
    assert not before.exists()
    assert BagReader(tmp_path / "adv").provenance["code_sha256"] == "7" * 64


def test_same_request_same_bytes(clean_bag, tmp_path):
    for parent in "ab":
        attack(clean_bag, tmp_path / parent / "adv", request(recipe="random"))
    assert files_of(tmp_path / "a" / "adv") == files_of(tmp_path / "b" / "adv")
    attack(clean_bag, tmp_path / "c" / "adv", request(recipe="random", seed=4))
    labels = [(tmp_path / p / "adv" / "labels.parquet").read_bytes() for p in "ac"]
    assert labels[0] != labels[1]


def test_same_bytes_on_one_worker_and_on_two(clean_bag, tmp_path, monkeypatch):
    monkeypatch.setattr("advpipe.pipeline.core.jobs.JOBS_WORTH_A_WORKER", 1)
    attack(clean_bag, tmp_path / "one" / "adv", request(), workers=1)
    attack(clean_bag, tmp_path / "two" / "adv", request(), workers=2)
    assert files_of(tmp_path / "one" / "adv") == files_of(tmp_path / "two" / "adv")


def test_frame_is_attacked_alike_alone_and_among_others(clean_bag, tmp_path):
    attack(clean_bag, tmp_path / "all", request(recipe="random"))
    attack(clean_bag, tmp_path / "one", request(recipe="random", frames="3"))
    clouds = {frame.stamp_ns: frame.cloud.tobytes() for frame in read_frames(tmp_path / "all")}
    (alone,) = read_frames(tmp_path / "one")
    assert clouds[alone.stamp_ns] == alone.cloud.tobytes()


def test_slice_holds_only_its_frames(clean_bag, tmp_path):
    attack(clean_bag, tmp_path / "adv", request(frames="1:4:2"))
    clean, adversarial = raw_by_topic(clean_bag), raw_by_topic(tmp_path / "adv")
    assert len(adversarial[LIDAR]) == 2
    assert adversarial["/ego/ground_truth/objects"] == clean["/ego/ground_truth/objects"][1:4:2]
    assert adversarial[CLOCK.name] == clean[CLOCK.name][5:10] + clean[CLOCK.name][15:20]
    for latched in ("/tf_static", "/scenario/info"):
        assert [raw.cdr for raw in adversarial[latched]] == [raw.cdr for raw in clean[latched]]
        assert adversarial[latched][0].log_time_ns == clean[LIDAR][1].log_time_ns
    assert set(table(tmp_path / "adv" / "labels.parquet")["frame"].tolist()) == {1, 3}
    assert [len(f.boxes) for f in read_frames(tmp_path / "adv")] == [1, 1]  # TF and odometry still fit


def finish_and_compare(clean_bag, tmp_path, monkeypatch):
    """Go on with the interrupted request; redo nothing; end with the bytes of a run in one go."""
    monkeypatch.setattr(linear_detector.Interrupted, "occupancy_loss", linear_detector.Shipped.occupancy_loss)
    linear_detector.Shipped.gradients = 0
    attack(clean_bag, tmp_path / "adv", request(detector=INTERRUPTED))
    assert linear_detector.Shipped.gradients == 30  # frames 2, 3 and 5; 4 has no object
    attack(clean_bag, tmp_path / "whole" / "adv", request(detector=INTERRUPTED))
    assert files_of(tmp_path / "adv") == files_of(tmp_path / "whole" / "adv")
    assert not list(tmp_path.glob(".*"))


def test_interrupted_run_leaves_nothing_and_goes_on(clean_bag, tmp_path, monkeypatch):
    with pytest.raises(KeyboardInterrupt):
        attack(clean_bag, tmp_path / "adv", request(detector=INTERRUPTED))
    assert not (tmp_path / "adv").exists()
    finish_and_compare(clean_bag, tmp_path, monkeypatch)


def test_killed_run_leaves_nothing_and_goes_on(clean_bag, tmp_path, monkeypatch):
    program = f"""
from pathlib import Path
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.run import AttackRequest, attack
attack(Path({str(clean_bag)!r}), Path({str(tmp_path / "adv")!r}), {request(detector=INTERRUPTED)!r})
"""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent), "ATTACK_TEST_KILL": "1"}
    run = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, check=False)
    assert run.returncode == -9, run.stderr.decode()
    assert not (tmp_path / "adv").exists()
    finish_and_compare(clean_bag, tmp_path, monkeypatch)


def test_another_request_does_not_take_over_the_frames(clean_bag, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        attack(clean_bag, tmp_path / "adv", request(detector=INTERRUPTED))
    linear_detector.Shipped.gradients = 0
    attack(clean_bag, tmp_path / "adv", request(parameters={"ratio": 0.2}))
    assert linear_detector.Shipped.gradients == 50
    assert not list(tmp_path.glob(".*"))  # what the first one left is gone too


def test_same_request_twice_at_a_time_is_refused(clean_bag, tmp_path, monkeypatch):
    find = linear_detector.Shipped.occupancy_loss

    def meanwhile(self, *targets):
        monkeypatch.setattr(linear_detector.Shipped, "occupancy_loss", find)
        with pytest.raises(AdvpipeError, match="locked by another run"):
            attack(clean_bag, tmp_path / "adv", request())
        return find(self, *targets)

    monkeypatch.setattr(linear_detector.Shipped, "occupancy_loss", meanwhile)
    attack(clean_bag, tmp_path / "adv", request())
    assert not list(tmp_path.glob(".*"))


def test_two_requests_for_one_output_leave_each_other_alone(clean_bag, tmp_path, monkeypatch):
    other = request(parameters={"ratio": 0.2})
    find = linear_detector.Shipped.occupancy_loss

    def meanwhile(self, *targets):
        monkeypatch.setattr(linear_detector.Shipped, "occupancy_loss", find)
        attack(clean_bag, tmp_path / "adv", other)
        return find(self, *targets)

    monkeypatch.setattr(linear_detector.Shipped, "occupancy_loss", meanwhile)
    with pytest.raises(AdvpipeError, match="exists"):
        attack(clean_bag, tmp_path / "adv", request())
    assert yaml.safe_load((tmp_path / "adv" / "attack.yaml").read_text())["parameters"]["ratio"] == 0.2


def test_frames_of_a_detector_whose_code_changed_are_done_anew(clean_bag, tmp_path, monkeypatch):
    source = tmp_path / "code" / "changing_detector.py"
    source.parent.mkdir()
    source.write_text("from linear_detector import Interrupted\nclass Mine(Interrupted): pass\n")
    monkeypatch.syspath_prepend(str(source.parent))
    mine = request(detector="changing_detector:Mine")
    with pytest.raises(KeyboardInterrupt):
        attack(clean_bag, tmp_path / "adv", mine)
    source.write_text("from linear_detector import Shipped\nclass Mine(Shipped): pass\n")
    monkeypatch.delitem(sys.modules, "changing_detector")
    importlib.invalidate_caches()
    linear_detector.Shipped.gradients = 0
    attack(clean_bag, tmp_path / "adv", mine)
    assert linear_detector.Shipped.gradients == 50
    assert BagReader(tmp_path / "adv").provenance["detector_sha256"] == parent_sha256(source)


def test_failed_writing_leaves_nothing(clean_bag, tmp_path, monkeypatch):
    def full_disk(*_):
        raise AdvpipeError("disk full")

    monkeypatch.setattr(BagWriter, "copy", full_disk)
    with pytest.raises(AdvpipeError, match="disk full"):
        attack(clean_bag, tmp_path / "adv", request())
    assert not (tmp_path / "adv").exists()


def test_existing_output(clean_bag, tmp_path):
    attack(clean_bag, tmp_path / "adv", request())
    before = files_of(tmp_path / "adv")
    with pytest.raises(OutputExistsError):
        attack(clean_bag, tmp_path / "adv", request(seed=4))
    assert files_of(tmp_path / "adv") == before
    attack(clean_bag, tmp_path / "adv", request(seed=4), overwrite=True)
    assert files_of(tmp_path / "adv")["attack.yaml"] != before["attack.yaml"]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"type": "detatch"}, "unknown attack 'detatch'; did you mean 'detach'"),
        ({"recipe": "worst"}, "recipe is 'worst'; known: best, .*paper, score-based"),
        ({"parameters": {}}, "ratio is missing; pass ratio"),
        ({"parameters": {"ratio": 2.0}}, "ratio is 2.0"),
        ({"parameters": {"ratio": 0.1, "eps": 0.1}}, "unknown parameter 'eps'; known: ratio, rounds"),
        ({"detector": "large"}, "unknown detector 'large'"),
        ({"detector": "nothing.safetensors"}, "no detector checkpoint at nothing.safetensors"),
        ({"frames": "6:9"}, "select none of the bag's 6 frames"),
    ],
)
def test_bad_request_is_one_line_and_leaves_nothing(clean_bag, tmp_path, changes, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        attack(clean_bag, tmp_path / "adv", request(**changes))
    assert "\n" not in str(caught.value)
    assert [item.name for item in tmp_path.iterdir()] == ["clean"]


def test_bag_without_clouds(tmp_path):
    with BagWriter(tmp_path / "blind", provenance={}) as bag:
        bag.write(CLOCK, build.clock(7), 7)
    with pytest.raises(AdvpipeError, match="no LiDAR clouds"):
        attack(tmp_path / "blind", tmp_path / "adv", request())
    with BagWriter(tmp_path / "empty", provenance={}):
        pass
    with pytest.raises(AdvpipeError, match="holds no messages"):
        attack(tmp_path / "empty", tmp_path / "adv", request())


def test_missing_bag(tmp_path):
    with pytest.raises(AdvpipeError, match="does not exist"):
        attack(tmp_path / "nothing", tmp_path / "adv", request())


@pytest.mark.parametrize("target", [".", "clean"])
def test_output_must_not_replace_the_clean_bag(clean_bag, tmp_path, target):
    before = files_of(clean_bag)
    with pytest.raises(AdvpipeError, match="clean bag"):
        attack(clean_bag, tmp_path / target, request(), overwrite=True)
    assert files_of(clean_bag) == before


@pytest.mark.parametrize("recipe", ["best", "paper"])
def test_attacks_second_the_same_way_twice(clean_bag, tmp_path, recipe):
    torch.manual_seed(0)
    save_checkpoint(SecondNet(SMALL), tmp_path / "random.safetensors", {})
    wanted = request(
        recipe=recipe,
        parameters={"ratio": 0.1, "rounds": 2},
        detector=str(tmp_path / "random.safetensors"),
        frames="2",
    )
    for parent in "ab":
        attack(clean_bag, tmp_path / parent / "adv", wanted)
    assert files_of(tmp_path / "a" / "adv") == files_of(tmp_path / "b" / "adv")
    (frame,) = pq.read_table(str(tmp_path / "a" / "adv" / "frames.parquet")).to_pylist()
    assert frame["points_adversarial"] == 452
    assert np.isfinite([frame["loss_before"], frame["loss_after"]]).all()
