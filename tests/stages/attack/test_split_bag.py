"""A drive of several files: an attack reads it like the same drive in one, and splits what it makes."""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.part import BagSplit
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.clouds import CloudPlan
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.attack.selected import messages_of_frames

DETECTOR, LIDAR = "linear_detector:Shipped", "/ego/lidar/points"
SCENARIO = "recording:\n  split_s: 0.2\n"


def split_drive(clean_bag: Path, path: Path) -> Path:
    """The drive in three files of two clouds."""
    whole = BagReader(clean_bag)
    provenance = {**whole.provenance, "scenario": SCENARIO}
    split = BagSplit.of(Provenance(provenance))
    with BagWriter(path, provenance=provenance, split=split) as writer:
        for raw in whole.raw_messages():
            writer.copy(raw)
    return path


def test_an_attack_on_a_split_drive(clean_bag: Path, tmp_path: Path) -> None:
    assert len(list(split_drive(clean_bag, tmp_path / "drive").glob("*.mcap"))) == 3
    request = AttackRequest((AttackSpec(type="detach", parameters={"ratio": 0.1}, detector=DETECTOR),), 3)
    for bag in ("clean", "drive"):
        attack(tmp_path / bag, tmp_path / f"{bag}-adv", request)
    one, other = tmp_path / "clean-adv", tmp_path / "drive-adv"
    assert [path.name for path in sorted(other.glob("*.mcap"))] == [f"drive-adv_{n}.mcap" for n in range(3)]
    assert list(BagReader(other).raw_messages()) == list(BagReader(one).raw_messages())
    assert (one / "labels.parquet").read_bytes() == (other / "labels.parquet").read_bytes()
    assert len(list(read_frames(other))) == 6


def test_chosen_frames_are_read_and_the_other_files_stay_closed(
    clean_bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = split_drive(clean_bag, tmp_path / "drive")
    request = AttackRequest(
        (AttackSpec(type="detach", parameters={"ratio": 0.1}, frames="2", detector=DETECTOR),), 3
    )
    for bag, name in ((clean_bag, "whole"), (drive, "part")):
        attack(bag, tmp_path / name, request)
    assert list(BagReader(tmp_path / "part").raw_messages()) == list(
        BagReader(tmp_path / "whole").raw_messages()
    )
    reader = BagReader(drive)
    plan = CloudPlan((LIDAR,), range(2, 3), reader.log_times_ns(LIDAR), ())
    opened, really_open = list[str](), Path.open

    def noted(path: Path, mode: str) -> IO[Any]:
        opened.append(path.name)
        return really_open(path, mode)

    monkeypatch.setattr(Path, "open", noted)
    assert [frame for frame, _ in messages_of_frames(reader, plan) if frame is not None] == [2]
    assert opened == ["drive_0.mcap", "drive_1.mcap"]  # the first for its latched topics
