"""Attacks on several clouds at once: what they come to, in what groups, and after a stop."""

from __future__ import annotations

from dataclasses import replace

import linear_detector
import numpy as np
import pytest
import torch
import yaml

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector import device
from advpipe.pipeline.detector.batching import run_batched
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import SMALL
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.cloud_attack import groups_of
from advpipe.stages.attack.clouds import AttackedCloud
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb
from advpipe.stages.attack.run import AttackRequest, attack

BUDGETS = {"detach": {"ratio": 0.1}, "perturb": {"eps_cm": 30}, "attach": {"eps_m": 0.5, "points": 20}}


@pytest.fixture(autouse=True)
def _counted_from_zero(monkeypatch):
    monkeypatch.setattr(linear_detector.Batched, "batches", 0)


def request(attack_name="detach", detector="Batched", **changes):
    spec = AttackSpec(
        type=attack_name, parameters=BUDGETS[attack_name], detector=f"linear_detector:{detector}", **changes
    )
    return AttackRequest((spec,), 3)


def at_once(monkeypatch, count):
    monkeypatch.setitem(device.FRAMES_AT_ONCE, "cpu", count)


def outcome(folder):
    """The clouds, and what is said of them."""
    tables = [(folder / f"{name}.parquet").read_bytes() for name in ("labels", "frames")]
    return [frame.cloud.tobytes() for frame in read_frames(folder)], tables


@pytest.mark.parametrize("attack_name", BUDGETS)
def test_four_at_once_come_to_the_same_as_one_by_one(clean_bag, tmp_path, monkeypatch, attack_name):
    attack(clean_bag, tmp_path / "one", request(attack_name))
    assert linear_detector.Batched.batches == 0
    at_once(monkeypatch, 4)
    attack(clean_bag, tmp_path / "four", request(attack_name))
    assert linear_detector.Batched.batches > 10
    assert outcome(tmp_path / "one") == outcome(tmp_path / "four")


def test_what_is_recorded(clean_bag, tmp_path, monkeypatch):
    attack(clean_bag, tmp_path / "one", request(recipe="random"))
    assert "frames_at_once" not in (tmp_path / "one" / "attack.yaml").read_text()
    at_once(monkeypatch, 4)
    attack(clean_bag, tmp_path / "four", request(recipe="random"))
    (resolved,) = yaml.safe_load((tmp_path / "four" / "attack.yaml").read_text())["attacks"]
    assert resolved["frames_at_once"] == "4"
    assert BagReader(tmp_path / "four").provenance["code_sha256"]


def test_a_detector_without_batches_gets_its_frames_one_by_one(clean_bag, tmp_path, monkeypatch):
    attack(clean_bag, tmp_path / "one", request(detector="Shipped"))
    at_once(monkeypatch, 4)
    attack(clean_bag, tmp_path / "four", request(detector="Shipped"))
    assert outcome(tmp_path / "one") == outcome(tmp_path / "four")


def test_a_stopped_run_does_unfinished_groups_again_as_a_whole(clean_bag, tmp_path, monkeypatch):
    at_once(monkeypatch, 4)
    attack(clean_bag, tmp_path / "whole", request())
    needed = linear_detector.Batched.batches
    monkeypatch.setattr(linear_detector.Batched, "batches", 0)
    monkeypatch.setattr(linear_detector.Batched, "interrupted_at", needed - 1)  # in the second group
    with pytest.raises(KeyboardInterrupt):
        attack(clean_bag, tmp_path / "adv", request())
    (job,) = tmp_path.glob(".adv.*.job")
    assert sorted(file.name for file in job.glob("*.npz")) == [f"{n:06d}.npz" for n in range(4)]
    (job / "000001.npz").unlink()  # as if it had been killed while it stored
    monkeypatch.setattr(linear_detector.Batched, "batches", 0)
    monkeypatch.setattr(linear_detector.Batched, "interrupted_at", -1)
    attack(clean_bag, tmp_path / "adv", request())
    assert linear_detector.Batched.batches == needed
    assert outcome(tmp_path / "adv") == outcome(tmp_path / "whole")


def test_groups_are_of_one_attack_and_of_so_many_at_most():
    clouds = [AttackedCloud("/a", frame, 0) for frame in range(5)]
    clouds += [AttackedCloud("/b", frame, 1) for frame in range(2)]
    assert groups_of(clouds, 2) == [(0, 1), (2, 3), (4,), (5, 6)]
    assert groups_of(clouds, 1) == [(place,) for place in range(7)]


def unkept(attack):
    """The attack with its last attempt: it need not do harm, which to random weights it hardly does."""
    attack.settings = replace(attack.settings, keep_best=False)
    return attack


@pytest.mark.parametrize(
    "make",
    [
        lambda: unkept(Perturb(eps_cm=20, steps=3)),
        lambda: Perturb(eps_cm=20, recipe="paper", steps=3),
        lambda: Detach(ratio=0.05, rounds=2),
        lambda: Attach(eps_m=0.5, points=20, rounds=2),
    ],
)
def test_second_is_attacked_in_batches_as_one_by_one(make_cloud, make_boxes, make):
    torch.manual_seed(5)
    tiny = replace(SMALL, name="tiny", range_m=Range(-6.4, -6.4, -3.1, 6.4, 6.4, 2.3))
    net = SecondNet(tiny)
    torch.nn.init.normal_(net.head.convolution.weight, std=0.05)
    detector = Second(net)
    draw = np.random.default_rng(2)
    things = [draw.uniform((1, 0, -1.8), (5, 2, -0.2), (150, 3)) for _ in range(2)]
    ground = [np.column_stack([draw.uniform(-6.3, 6.3, (300, 2)), np.full(300, -1.75)]) for _ in range(2)]
    clouds = [make_cloud(np.concatenate(pair)) for pair in zip(things, ground, strict=True)]
    clouds += [make_cloud(np.zeros((0, 3))), make_cloud(ground[0])]
    boxes = make_boxes([3.0, 1.0, -1.0, 4.0, 2.0, 1.6, 0.0])
    truths = [boxes, boxes, boxes, make_boxes()]  # two to attack, one without points, one without objects

    def work(number):
        return lambda seen: make()(clouds[number], truths[number], seen, np.random.default_rng(number))

    together = run_batched(detector, [work(number) for number in range(4)])
    for number, result in enumerate(together):
        alone = work(number)(detector)
        assert result.note == alone.note
        np.testing.assert_allclose(
            [result.loss_before, result.loss_after], [alone.loss_before, alone.loss_after], rtol=1e-3
        )
        np.testing.assert_array_equal(result.labels.point, alone.labels.point)
        # Sums of a batch are rounded elsewhere, and an activation near zero may be on its other side.
        np.testing.assert_allclose(result.labels.displacement_m, alone.labels.displacement_m, atol=0.005)
    assert [bool(len(result.labels)) for result in together] == [True, True, False, False]
