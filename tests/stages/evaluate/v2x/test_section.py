"""The report's part on V2X, of a real drive and its attack."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.config import DetectorConfig
from advpipe.pipeline.misbehaviour.scores import Scores
from advpipe.stages.evaluate.report.section import SECTION, Section
from advpipe.stages.evaluate.v2x.section import read_drive, section, sections


@pytest.fixture(scope="module")
def found(smoke: Path, offset: Path) -> Section:
    (one,) = sections(smoke, [offset], 0)
    return one


def test_section(found: Section, offset: Path) -> None:
    assert found.key == "v2x"
    for table in found.tables:
        assert all(len(line) == len(table.heads) for line in table.lines)
    detection, victim, radio, checks = found.tables
    assert detection.lines[0][:2] == (offset.name, "cam-position-offset")
    assert [line[0] for line in victim.lines] == ["clean", offset.name]
    assert len(radio.lines) == 2
    assert len(checks.lines) > 15
    assert [picture.file_name for picture in found.pictures] == [
        "v2x-detection.png",
        f"{offset.name}-ldm.png",
        f"{offset.name}-ldm-error.png",
    ]
    for picture in found.pictures:
        assert picture.section == SECTION
        assert picture.png.startswith(b"\x89PNG")
    clean, attacked = found.records
    assert attacked["f1"] > 0.7  # type: ignore[operator]
    assert attacked["ldm_displaced"] > clean["ldm_displaced"]  # type: ignore[operator]
    assert clean["radio_delivered"] == attacked["radio_delivered"]  # nothing was added or left out
    assert clean["lies"] == 0


def test_pictures_are_the_same_again(found: Section, smoke: Path, offset: Path) -> None:
    (again,) = sections(smoke, [offset], 1)  # no draw depends on the seed
    assert [p.png for p in again.pictures] == [p.png for p in found.pictures]
    np.testing.assert_equal(again.records, found.records)


def test_nothing_to_say_without_attacks_on_messages(smoke: Path) -> None:
    assert sections(smoke, [], 0) == ()
    assert sections(smoke, [smoke], 0) == ()


def test_bags_without_lies_do_not_count_in_the_mean(smoke: Path, offset: Path) -> None:
    """Messages left out are no lies to find: 3 honest ones flagged would make F1 0."""
    clean, lied = read_drive(smoke, "clean"), read_drive(offset, "offset")
    none = replace(lied.detection, lies=0, ours=Scores(0, 3, 10, 0), baseline=Scores(0, 3, 10, 0))
    lead = section(clean, [lied, replace(lied, name="drop", detection=none)], DetectorConfig()).lead
    assert lead == section(clean, [lied], DetectorConfig()).lead
    assert lead.startswith("Mean F1 over 1 bags with lies ")
