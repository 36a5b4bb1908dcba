"""One bag's V2X where there is little of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from section_rows import rows_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.labels.messages import MessageLabel
from advpipe.stages.evaluate.v2x.drive import EvaluatedDrive, read_drive
from advpipe.stages.evaluate.v2x.radio import MessageNumbers
from advpipe.stages.evaluate.v2x.section import section
from advpipe.stages.evaluate.v2x.tables import victim_table

ODOMETRY = "/ego/odometry"


@pytest.fixture(scope="module")
def clean(smoke: Path) -> EvaluatedDrive:
    return read_drive(smoke, "clean")


def test_the_most_affected_listener(clean: EvaluatedDrive) -> None:
    assert clean.most_affected_listener == "ego"


def test_the_map_during_an_attack_is_of_its_time(clean: EvaluatedDrive) -> None:
    """One ghost while it lasts is shown, not nine long after."""
    times_ns = [moment.time_ns for moment in clean.moments["ego"]]
    false_entries = np.zeros(len(times_ns))
    false_entries[2], false_entries[-1] = 1, 9
    error = replace(
        clean.errors["ego"],
        false_entries=false_entries,
        missing=0 * false_entries,
        displaced=0 * false_entries,
    )
    false_labels = [MessageLabel(n, "cam-dos", "a", "changed", True, times_ns[n], 7) for n in (1, 3)]
    drive = replace(clean, errors={"ego": error}, labels=false_labels)
    assert [moment.time_ns for moment in drive.maps_around_attack("ego")] == [times_ns[1], times_ns[2]]
    at_once = replace(drive, labels=false_labels[:1])
    assert [moment.time_ns for moment in at_once.maps_around_attack("ego")] == [times_ns[1], times_ns[-1]]


def test_nobody_listens(clean: EvaluatedDrive) -> None:
    """No map, so no picture of one, nor a line about a victim."""
    silent = replace(clean, name="silent", errors={}, moments={}, warned={}, received={})
    assert silent.most_affected_listener is None
    made = section(clean, [silent])
    assert not made.pictures
    assert [record["bag"] for record in rows_of(made)] == ["clean"]


def test_delivery_is_of_the_same_messages(clean: EvaluatedDrive) -> None:
    """Of 1 to 4, the clean drive delivers 1, 2 and 4; with 4 forged, 1, 2 and 3 are honest: two before, one
    under attack. What is far away counts for nothing."""
    near = frozenset({1, 2, 3, 4})
    before = replace(clean, received={"ego": MessageNumbers(near, frozenset({1, 2, 4, 9}))})
    forged = MessageLabel(4, "cam-dos", "a", "changed", True, 0, 7)
    after = replace(
        clean, name="dos", received={"ego": MessageNumbers(near, frozenset({1, 4, 9}))}, labels=[forged]
    )
    lines = victim_table([before, after]).lines
    assert [line[-1] for line in lines] == ["75.0", "66.7 → 33.3"]
    nothing = replace(
        clean, name="all", received={"ego": MessageNumbers(frozenset({4}), near)}, labels=[forged]
    )
    assert victim_table([before, nothing]).lines[1][-1] == "– → –"


def test_a_vehicle_that_estimated_nothing(clean: EvaluatedDrive, smoke: Path, tmp_path: Path) -> None:
    """The topic is there, but empty: the truth stands in for what the vehicle believes."""
    reader = BagReader(smoke)
    with BagWriter(tmp_path / "bag", provenance=reader.provenance) as bag:
        for raw in reader.raw_messages():
            if raw.topic.name == ODOMETRY:
                bag._parts[-1]._new_channel(raw, raw.topic.type_hash)
            else:
                bag.copy(raw)
    assert reader.topics[ODOMETRY].count > 0
    assert BagReader(tmp_path / "bag").topics[ODOMETRY].count == 0
    found = read_drive(tmp_path / "bag", "mute")
    assert found.warned["ego"].dangers == clean.warned["ego"].dangers
