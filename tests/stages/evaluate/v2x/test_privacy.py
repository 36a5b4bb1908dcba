from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.evaluate.run import evaluate
from advpipe.stages.evaluate.v2x.privacy import privacy_record, privacy_sections
from advpipe.stages.simulate.run import simulate

ALONE = ("vehicles={}", "simulation.duration_s=6", "v2x.penetration=1")


def test_a_tracker_follows_changes_without_a_silence(tmp_path: Path) -> None:
    settings = [*ALONE, "v2x.pseudonyms={period_s: 2}"]
    clean = simulate(load_scenario("smoke", settings), tmp_path / "drive").bag
    record = privacy_record(BagReader(clean))
    assert record.strategy == "period"
    assert record.changes > 40
    assert record.success > 0.9
    assert record.tracked > 0.9
    assert record.linked == sum(one.linked for one in record.by_density)
    assert record.changes == sum(one.changes for one in record.by_density)
    (section,) = privacy_sections(clean)
    assert section.records == (record,)
    assert section.tables[0].lines[-1][0] == "11 or more"
    assert f"follows {record.linked:,} of {record.changes:,} " in section.terminal[0].title
    report = evaluate(clean, (), tmp_path / "report")  # as the documentation does, without any LiDAR
    assert [each.key for each in report.sections] == ["privacy"]


def test_a_drive_without_pseudonyms_has_no_section(smoke: Path) -> None:
    assert privacy_sections(smoke) == ()
