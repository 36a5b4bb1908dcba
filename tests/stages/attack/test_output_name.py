"""What the bag of an attack is called."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.output_name import attack_id, output_name
from advpipe.stages.attack.request import AttackRequest


def request(**changes):
    given = {"type": "detach", "parameters": {"ratio": 0.01}, **changes}
    return AttackRequest((AttackSpec(**given),))


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, "detach-best-0.01"),
        ({"parameters": {"ratio": 0.015}, "recipe": "paper"}, "detach-paper-0.015"),
        ({"parameters": {"ratio": 0.01, "rounds": 10}}, "detach-best-0.01"),
        ({"parameters": {"ratio": 0.01, "rounds": 20}}, "detach-best-0.01-rounds20"),
    ],
)
def test_attack_id(changes, name):
    assert attack_id(request(**changes)) == name


def test_what_attackers_sign_with_is_in_the_name():
    names = [
        attack_id(request(type="cam-drop", parameters={}, credentials=one)) for one in ("ticket", "none")
    ]
    assert names == ["cam-drop", "cam-drop-credentials-none"]


def test_another_radio_is_in_the_name():
    assert attack_id(request(type="cam-drop", parameters={}, network="artery")) == "cam-drop-artery"


def reader_of(path, *lidars):
    with BagWriter(path, provenance={}) as bag:
        for vehicle, name in lidars:
            topics = VehicleTopics(vehicle, name)
            cdr = cloud_to_cdr(np.zeros(3, POINT_DTYPE), 1, topics.lidar_frame)
            bag.write_cdr(topics.lidar_points, cdr, 1)
    return BagReader(path)


def test_another_lidar_than_the_default_is_in_the_name(tmp_path):
    reader = reader_of(tmp_path / "bag", ("ego", "lidar"), ("ego", "rear"), ("bus", "lidar"))
    assert output_name(request(), reader) == "detach-best-0.01"
    assert output_name(request(lidar="/ego/lidar/points"), reader) == "detach-best-0.01"
    assert output_name(request(lidar="/ego/rear/points"), reader) == "detach-best-0.01-ego-rear"
    assert output_name(request(victim="bus"), reader) == "detach-best-0.01-bus-lidar"
    assert output_name(request(type="gnss-jam", parameters={}), reader) == "gnss-jam"
    with pytest.raises(UsageError, match="has no clouds on /x/points"):
        output_name(request(lidar="/x/points"), reader)


def test_the_only_lidar_is_not(tmp_path):
    reader = reader_of(tmp_path / "bag", ("bus", "roof"))
    assert output_name(request(lidar="/bus/roof/points"), reader) == "detach-best-0.01"
