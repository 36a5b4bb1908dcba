"""One bag's V2X where there is little of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.misbehaviour.config import DetectorConfig
from advpipe.stages.evaluate.v2x.drive import Drive, read_drive
from advpipe.stages.evaluate.v2x.section import section

ODOMETRY = "/ego/odometry"


@pytest.fixture(scope="module")
def clean(smoke: Path) -> Drive:
    return read_drive(smoke, "clean")


def test_the_most_fooled(clean: Drive) -> None:
    assert clean.most_fooled == "ego"


def test_nobody_listens(clean: Drive) -> None:
    """No map, so no picture of one, nor a line about a victim."""
    silent = replace(clean, name="silent", errors={}, moments={}, warned={}, honest_delivered={})
    assert silent.most_fooled is None
    made = section(clean, [silent], DetectorConfig())
    assert [picture.file_name for picture in made.pictures] == ["v2x-detection.png"]
    assert [record["bag"] for record in made.records] == ["clean"]


def test_a_vehicle_that_estimated_nothing(clean: Drive, smoke: Path, tmp_path: Path) -> None:
    """The topic is there, but empty: the truth stands in for what the vehicle believes."""
    reader = BagReader(smoke)
    with BagWriter(tmp_path / "bag", provenance=reader.provenance) as bag:
        for raw in reader.raw_messages():
            if raw.topic.name == ODOMETRY:
                bag._channel(raw.topic, raw.schema, raw.schema_encoding, raw.topic.type_hash)
            else:
                bag.copy(raw)
    assert reader.topics[ODOMETRY].count > 0
    assert BagReader(tmp_path / "bag").topics[ODOMETRY].count == 0
    found = read_drive(tmp_path / "bag", "mute")
    assert found.warned["ego"].dangers == clean.warned["ego"].dangers
