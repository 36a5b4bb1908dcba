"""An adversarial bag holds the chosen frames of each LiDAR, and latched topics whole."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.messages.topics import TF_STATIC
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.clouds import CloudPlan
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.attack.selected import messages_of_frames
from advpipe.stages.verify.run import verify

DETECTOR = "linear_detector:Shipped"
LIDAR, REAR = "/ego/lidar/points", "/ego/rear/points"
CHOSEN = [(topic, frame) for frame in (3, 4) for topic in (LIDAR, REAR)]


@pytest.fixture
def latched_drive(clean_bag: Path, tmp_path: Path) -> Path:
    """The drive with a second LiDAR, which records 1 ms later; both publish as /tf_static does."""
    whole, path = BagReader(clean_bag), tmp_path / "drive" / "clean"
    with BagWriter(path, provenance=whole.provenance) as writer:
        for raw in whole.raw_messages():
            if raw.topic.name != LIDAR:
                writer.copy(raw)
                continue
            for name, late_ns in ((LIDAR, 0), (REAR, 1_000_000)):
                topic = replace(raw.topic, name=name, qos=TF_STATIC.qos)
                writer.copy(replace(raw, topic=topic, log_time_ns=raw.log_time_ns + late_ns))
    return path


def test_clouds_of_a_latched_topic_are_attacked_like_others(latched_drive: Path, tmp_path: Path) -> None:
    specs = [
        AttackSpec(type="detach", parameters={"ratio": 0.1}, frames="3:5", detector=DETECTOR, lidar=lidar)
        for lidar in (LIDAR, REAR)
    ]
    attack(latched_drive, tmp_path / "drive" / "adv", AttackRequest(tuple(specs), 3))
    rows = pq.read_table(str(tmp_path / "drive" / "adv" / "frames.parquet")).to_pylist()
    assert [(row["topic"], row["frame"], row["attack"]) for row in rows] == [
        (topic, frame, "detach") for topic, frame in CHOSEN
    ]
    assert not {finding.check for finding in verify(tmp_path / "drive").findings} & {"copies", "points"}


@pytest.mark.parametrize("has_changes", [False, True])
def test_clouds_of_two_latched_topics(latched_drive: Path, has_changes: bool) -> None:
    reader = BagReader(latched_drive)
    plan = CloudPlan((LIDAR, REAR), range(3, 5), reader.log_times_ns(LIDAR), ())
    changed = reader.raw_messages() if has_changes else None
    messages = list(messages_of_frames(reader, plan, changed))
    assert [(raw.topic.name, frame) for frame, raw in messages if frame is not None] == CHOSEN
    assert [raw.topic.name for _, raw in messages].count(TF_STATIC.name) == 1
