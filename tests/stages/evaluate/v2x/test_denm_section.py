"""A drive with pseudonyms and DENMs, attacked: what the report says, and that everything fits together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.misbehaviour.detectors import MISBEHAVIOUR_DETECTORS
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.evaluate.v2x.denm_section import denm_sections
from advpipe.stages.evaluate.v2x.ldm_error import ldm_error, moments
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.evaluate.v2x.section import v2x_sections
from advpipe.stages.simulate.run import simulate
from advpipe.stages.verify.run import verify

SETTINGS = (
    "simulation.duration_s=4",
    "v2x.penetration=1",
    "v2x.denm={stopped_s: 0.3, braking_mps2: 2.0, time_to_collision_s: 3}",
    "v2x.pseudonyms={period_s: 1.5}",
    "sensors.lidars={}",
)
MOST_FLAGGED = 0.02
"""Share of honest messages that a detector with the pseudonyms linked may flag in this drive."""


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("denms") / "drive"
    return simulate(load_scenario("smoke", SETTINGS), out).bag


@pytest.fixture(scope="module")
def bags(clean: Path) -> list[Path]:
    found = []
    for name in ("denm-false", "denm-suppress"):
        found.append(clean.parent / name)
        attack(clean, found[-1], AttackRequest((AttackSpec(type=name),)))
    return found


def test_false_and_suppressed_events_are_counted(clean: Path, bags: list[Path]) -> None:
    (section,) = denm_sections(clean, bags)
    honest, false, suppressed = section.records
    assert honest.false_messages == honest.false_events == honest.suppressed == 0
    assert honest.events >= honest.known > 5
    assert honest.messages > 20
    assert honest.false_positive_rate == 0
    assert false.false_events > 3
    assert false.suppressed == 0
    assert suppressed.suppressed > 3
    assert suppressed.false_events == 0
    assert suppressed.recall > 0.2
    assert section.tables[0].lines[1][:2] == ("denm-false", "ego")


def test_attacks_on_warnings_are_no_attacks_on_cams(clean: Path, bags: list[Path]) -> None:
    (found,) = v2x_sections(clean, bags)
    assert [record.attack for record in found.records] == ["", "denm-false", "denm-suppress"]
    assert not any(record.attacks for record in found.records)
    assert {table.title for table in found.tables}.isdisjoint({"Detection of false messages"})
    assert found.notes[0].startswith("denm-false, denm-suppress: no CAM is attacked")


def test_verify_finds_no_fault(clean: Path, bags: list[Path]) -> None:
    assert not verify(clean.parent).findings


def test_a_new_pseudonym_is_no_misbehaviour(clean: Path) -> None:
    reader = BagReader(clean)
    (linked,), (bare,) = (read_receptions(reader, is_linked=one) for one in (True, False))
    assert len({one.station_id for one in bare.claims}) > len({one.station_id for one in linked.claims}) + 10
    ours = MISBEHAVIOUR_DETECTORS["advpipe"]
    flagged = [float(np.mean(ours.judge(one.claims, one.receivers).flagged)) for one in (linked, bare)]
    assert flagged[0] <= MOST_FLAGGED < flagged[1]


def test_entries_of_old_pseudonyms_are_not_false(clean: Path) -> None:
    error = ldm_error(moments(BagReader(clean), "ego", 1.1))
    assert error.known.sum() > 100
    assert not error.false_entries.any()
