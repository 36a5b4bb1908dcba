"""The report's part on V2X, of a real drive and its attack."""

from __future__ import annotations

import math
import shutil
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from section_rows import rows_of

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.messages.topics import LANES
from advpipe.pipeline.misbehaviour.catch import BOUNDED_CATCH
from advpipe.pipeline.misbehaviour.config import CHECKS, THRESHOLDS
from advpipe.pipeline.misbehaviour.detectors import MISBEHAVIOUR_DETECTORS
from advpipe.pipeline.misbehaviour.roc import RocCurve
from advpipe.pipeline.misbehaviour.scores import Scores
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.evaluate.report.section import SECTION, ReportSection
from advpipe.stages.evaluate.v2x.detection import DetectorResult, ScoredAttack
from advpipe.stages.evaluate.v2x.section import read_drive, section, v2x_sections
from advpipe.stages.evaluate.v2x.tables import detection_table

NOTHING_FOUND = dict.fromkeys(
    MISBEHAVIOUR_DETECTORS, DetectorResult(Scores(0, 3, 10, 0), RocCurve((), (), math.nan))
)


@pytest.fixture(scope="module")
def found(smoke: Path, offset: Path) -> ReportSection:
    (one,) = v2x_sections(smoke, [offset], 0)
    return one


def test_section(found: ReportSection, offset: Path) -> None:
    assert found.key == "v2x"
    for table in found.tables:
        assert all(len(line) == len(table.heads) for line in table.lines)
    detection, comparison, victim, radio, checks, baseline = found.tables
    assert detection.lines[0][0].endswith("cam-position-offset")
    assert comparison.lines[0][0] == detection.lines[0][0]
    assert len(comparison.heads) == 1 + 3 * len(MISBEHAVIOUR_DETECTORS)
    assert [line[0] for line in victim.lines if line[0]] == ["clean", offset.name]
    assert len(radio.lines) == 2
    assert [line[0] for line in checks.lines] == list(CHECKS)
    limits = {line[0]: line[2] for line in checks.lines}
    assert "off" not in limits.values()
    assert (limits["frequency"], limits["decoding"]) == ("12.5 Hz", "0.5")  # a number alone has no unit
    assert limits["range"] == f"{THRESHOLDS['range']:.0f} m"
    assert found.notes == ()
    assert [line[0] for line in baseline.lines] == list(asdict(BOUNDED_CATCH))
    assert [picture.file_name for picture in found.pictures] == [
        "v2x-detection.png",
        "v2x-roc.png",
        f"{offset.name}-ldm.png",
        f"{offset.name}-ldm-error.png",
    ]
    for picture in found.pictures:
        assert picture.section == SECTION
        assert picture.png.startswith(b"\x89PNG")
    clean, attacked = rows_of(found)
    assert attacked["f1"] > 0.7  # type: ignore[operator]
    assert attacked["ldm_displaced"] > clean["ldm_displaced"]  # type: ignore[operator]
    assert clean["radio_delivered"] == attacked["radio_delivered"]  # nothing was added or left out
    assert clean["false_messages"] == 0
    assert clean["honest_delivered"] == clean["honest_delivered_clean"] > 0.8  # type: ignore[operator]
    assert attacked["honest_delivered"] == attacked["honest_delivered_clean"]  # nor was any link touched
    (one,) = attacked["attacks"]  # type: ignore[misc]
    assert one["f1"] == attacked["f1"]


def test_pictures_are_the_same_again(found: ReportSection, smoke: Path, offset: Path) -> None:
    (again,) = v2x_sections(smoke, [offset], 1)  # no draw depends on the seed
    assert [p.png for p in again.pictures] == [p.png for p in found.pictures]
    np.testing.assert_equal(rows_of(again), rows_of(found))


def test_nothing_to_say_without_attacks_on_messages(smoke: Path) -> None:
    assert v2x_sections(smoke, [], 0) == ()
    assert v2x_sections(smoke, [smoke], 0) == ()


def test_bags_without_false_messages_do_not_count_in_the_mean(smoke: Path, offset: Path) -> None:
    """Messages left out are no lies to find: 3 honest ones flagged would make F1 0."""
    clean, lied = read_drive(smoke, "clean"), read_drive(offset, "offset")
    none = replace(lied.detection, false_messages=0, detectors=NOTHING_FOUND)
    lead = section(clean, [lied, replace(lied, name="drop", detection=none)]).lead
    assert lead == section(clean, [lied]).lead
    assert lead.startswith("Mean F1 over 1 bag with false messages: ")


def test_lines_where_one_attack_is_all_or_no_message_is_false(offset: Path) -> None:
    """A mix has a line for itself and for each part, two attacks have one for both; without lies, dashes."""
    lied = read_drive(offset, "offset")
    (own,) = lied.detection.parts
    half = replace(own, attack="cam-mix / cam-delay", false_messages=own.false_messages - 1)
    none = replace(own, attack="cam-drop", false_messages=0, detectors=NOTHING_FOUND)

    def lines(*parts: ScoredAttack) -> list[tuple[str, ...]]:
        return list(detection_table([replace(lied, detection=replace(lied.detection, parts=parts))]).lines)

    assert [line[0] for line in lines(own, half)] == [f"offset: {each.attack}" for each in (own, half)]
    assert [line[0] for line in lines(half, half)] == [
        f"offset: {each}" for each in ("all", half.attack, half.attack)
    ]
    (found, dashes) = lines(own, none)
    assert "–" not in found[1:-1]
    assert dashes[:3] == ("offset: cam-drop", found[1], "0")
    assert set(dashes[3:-1]) == {"–"}


def test_attacks_that_met_nothing_are_named(smoke: Path, offset: Path, tmp_path: Path) -> None:
    idle = tmp_path / "idle"
    spec = AttackSpec(type="cam-drop", schedule=Schedule(from_s=0.0009, to_s=0.001))
    attack(smoke, idle, AttackRequest((spec,)))
    (found,) = v2x_sections(smoke, [idle, offset])
    assert {line[0].partition(":")[0] for line in found.tables[0].lines} == {offset.name}
    assert found.notes == ("idle: the attacks touched no message, so there is nothing to evaluate.",)
    assert v2x_sections(smoke, [idle]) == ()


def test_without_its_roads_a_bag_has_those_checks_off_and_the_report_says_so(
    smoke: Path, offset: Path, tmp_path: Path
) -> None:
    (on,) = v2x_sections(smoke, [offset])
    assert on.notes == ()
    assert "off" not in [line[2] for line in on.tables[4].lines]
    roadless = [without_lanes(bag, tmp_path / bag.name) for bag in (smoke, offset)]
    (off,) = v2x_sections(roadless[0], roadless[1:])
    assert [line[0] for line in off.tables[4].lines if line[2] == "off"] == ["position", "wrong_way"]
    (note,) = off.notes
    assert f"{roadless[0].name}, {roadless[1].name}: the bag does not hold its roads (/map/lanes)" in note


def without_lanes(bag: Path, copy: Path) -> Path:
    reader = BagReader(bag)
    with BagWriter(copy, provenance=reader.provenance) as writer:
        for raw in reader.raw_messages():
            if raw.topic.name != LANES.name:
                writer.copy(raw)
    for labels in bag.glob("*.parquet"):
        shutil.copy(labels, copy)
    return copy
