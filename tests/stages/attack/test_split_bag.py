"""A drive of several files: an attack reads it like the same drive in one, and splits what it makes."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.part import BagSplit
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack

SCENARIO = "recording:\n  split_s: 0.2\n"


def test_an_attack_on_a_split_drive(clean_bag: Path, tmp_path: Path) -> None:
    whole = BagReader(clean_bag)
    provenance = {**whole.provenance, "scenario": SCENARIO}
    with BagWriter(tmp_path / "drive", provenance=provenance, split=BagSplit.of(provenance)) as writer:
        for raw in whole.raw_messages():
            writer.copy(raw)
    assert len(list((tmp_path / "drive").glob("*.mcap"))) == 3
    detector = "linear_detector:Shipped"
    request = AttackRequest((AttackSpec(type="detach", parameters={"ratio": 0.1}, detector=detector),), 3)
    for bag in ("clean", "drive"):
        attack(tmp_path / bag, tmp_path / f"{bag}-adv", request)
    one, other = tmp_path / "clean-adv", tmp_path / "drive-adv"
    assert [path.name for path in sorted(other.glob("*.mcap"))] == [f"drive-adv_{n}.mcap" for n in range(3)]
    assert list(BagReader(other).raw_messages()) == list(BagReader(one).raw_messages())
    assert (one / "labels.parquet").read_bytes() == (other / "labels.parquet").read_bytes()
    assert len(list(read_frames(other))) == 6
