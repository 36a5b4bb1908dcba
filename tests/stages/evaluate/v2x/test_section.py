"""The report's part on V2X, of a real drive and its attack."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.stages.evaluate.report.section import SECTION, Section
from advpipe.stages.evaluate.v2x.section import sections


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
