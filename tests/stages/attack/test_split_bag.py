"""A drive of several files: an attack reads it like the same drive in one, and splits what it makes."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.part import BagSplit
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.mcap.reader import McapFile
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack

DETECTOR = "linear_detector:Shipped"
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
    attack(clean_bag, tmp_path / "whole", request)
    opened, read = set[str](), McapFile.raw_messages

    def noted(file: McapFile, names: Collection[str], first_ns: int | None, last_ns: int | None) -> object:
        if CLOCK.name in names:  # as only the writing of the bag reads it
            opened.add(file.path.name)
        return read(file, names, first_ns, last_ns)

    monkeypatch.setattr(McapFile, "raw_messages", noted)
    attack(drive, tmp_path / "part", request)
    monkeypatch.undo()
    assert opened == {"drive_1.mcap"}
    assert list(BagReader(tmp_path / "part").raw_messages()) == list(
        BagReader(tmp_path / "whole").raw_messages()
    )
