"""A second drive beside the clean one: it tells its scenario itself, and may have attacks of its own."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.messages.types import serialise
from advpipe.stages.share.run import share
from advpipe.stages.verify.run import verify


def drive_again(clean: Path, out: Path) -> None:
    """The same drive under another seed, as far as it says so."""
    reader = BagReader(clean)
    record = {**reader.provenance, "seed": "2"}
    record["scenario"] = record["scenario"].replace("seed: 1", "seed: 2")
    with BagWriter(out, provenance=record) as writer:
        for raw in reader.raw_messages():
            if raw.topic.name == "/scenario/info":
                message = reader.decode(raw)
                scenario = json.loads(message.data)
                scenario["simulation"]["seed"] = 2
                message.data = json.dumps(scenario)
                raw = replace(raw, cdr=serialise(message, raw.topic.type))
            writer.copy(raw)


def make_child_of(attack: Path, drive: Path) -> None:
    reader = BagReader(attack)
    record, raws = dict(reader.provenance), list(reader.raw_messages())
    with BagWriter(
        attack, provenance=record | {"parent_sha256": parent_sha256(drive)}, overwrite=True
    ) as out:
        for raw in raws:
            out.copy(raw)


def test_a_data_set_with_a_second_drive_is_shared(dataset: Path, tmp_path: Path) -> None:
    shutil.rmtree(dataset / "reports")
    drive_again(dataset / "clean", dataset / "evening")
    result = verify(dataset)
    assert result.findings == []
    make_child_of(dataset / "fewer_points", dataset / "evening")
    share(dataset, tmp_path / "out")
    card = (tmp_path / "out" / "README.md").read_text()
    assert "2 adversarial versions. 1 other drive is stored beside it." in card
    assert "another recorded drive" in card
    assert "the records of `fewer_points` name the SHA-256 of `evening`" in card
    assert "the records of `false_speed` name the SHA-256 of `clean`" in card
    assert verify(tmp_path / "out", quick=True).is_good
