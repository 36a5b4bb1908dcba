"""Verify: provenance records of bags, absurd in value or in shape, are found out by their own check."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from found_checks import checks_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.stages.verify.run import verify

ATTACKS = ("detach", "perturb", "attach", "cam", "delay", "dos", "gnss")


def with_record(bag: Path, change: Callable[[dict[str, str]], None]) -> None:
    """The bag with other words in its own record."""
    reader = BagReader(bag)
    record = dict(reader.provenance)
    change(record)
    raws = list(reader.raw_messages())
    writer = BagWriter(bag, provenance={}, overwrite=True)
    writer._provenance = record  # type: ignore[assignment]  # whatever it says
    with writer:
        for raw in raws:
            writer.copy(raw)


@pytest.mark.parametrize(
    ("check", "change"),
    [
        ("boxes", lambda scenario: scenario.replace("rotation_frequency: 10.0", "rotation_frequency: 0")),
        ("boxes", lambda _: "sensors: {lidars: 5}\n"),
        ("scenario", lambda _: "a: !!bool x\n"),
    ],
)
def test_provenance_records_with_implausible_values_are_faults(
    data_set: Path, check: str, change: Callable[[str], str]
) -> None:
    def both(record: dict[str, str]) -> None:
        text = record["scenario"].replace("motion_distortion: false", "motion_distortion: true")
        record["scenario"] = change(text)

    for name in ATTACKS:
        shutil.rmtree(data_set / name)
    with_record(data_set / "clean", both)
    assert check in checks_of(data_set)


@pytest.mark.parametrize("attacks", ["5", "[5]", "[{", "[" * 100_000, '[{"type": 5}]'])
def test_attacks_with_another_structure_are_faults(data_set: Path, attacks: str) -> None:
    for name in set(ATTACKS) - {"detach"}:
        shutil.rmtree(data_set / name)
    with_record(data_set / "detach", lambda record: record.update(attacks=attacks))
    assert "container" in checks_of(data_set)
    (said,) = {finding.what for finding in verify(data_set).findings if finding.check == "container"}
    assert "the provenance record: attacks" in said
