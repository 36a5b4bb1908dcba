"""A mAP ratio to a clean mAP near 0 is not shown as a percentage."""

from __future__ import annotations

import math

import pytest
from place_drive import hide_first_car, rows
from scored import evaluate

from advpipe.pipeline.results.metrics import ratio_reason
from advpipe.stages.evaluate.report.numbers import formatted_ratio
from advpipe.stages.evaluate.run import print_report


@pytest.mark.parametrize(
    ("map_clean", "interval", "reason"),
    [
        (0.0, None, "nothing found on the clean bag"),
        (0.03, (0.01, 0.05), "the clean mAP, 0.030, is below 0.05"),
        (0.3, (0.0, 0.6), "the 95 % interval of the clean mAP, 0.000 to 0.600, includes 0"),
        (0.05, (0.01, 0.1), ""),
        (0.3, None, ""),
    ],
)
def test_reasons(map_clean: float, interval: tuple[float, float] | None, reason: str) -> None:
    assert ratio_reason(map_clean, interval) == reason


def test_what_stands_for_it() -> None:
    assert formatted_ratio(math.nan, 0.03) == "not meaningful: clean AP 0.030"
    assert formatted_ratio(math.nan, 0.0) == "undefined: nothing found on the clean bag"
    assert formatted_ratio(None, 0.03) == "–"
    assert formatted_ratio(41.2, 0.5, 1) == "41.2"


@pytest.mark.usefixtures("no_pictures")
def test_a_report_says_why(clean, attacked, tmp_path, capsys) -> None:
    """A detector that finds one object a frame, after forty false ones."""
    bag = attacked(hide_first_car, frames=range(2))
    report = evaluate(clean, [bag], tmp_path / "report", detector="place_drive:FaintDetector")
    (row,) = rows(tmp_path / "report")
    assert 0 < row["map_clean"] < 0.05
    assert row["map_ratio_percent"] is row["map_ratio_ci95"] is None
    assert row["map_ratio_reason"] == f"the clean mAP, {row['map_clean']:.3f}, is below 0.05"
    assert any("mAP ratio not meaningful: the clean mAP" in note for note in row["notes"])
    not_meaningful = f"not meaningful: clean AP {row['map_clean']:.3f}"
    assert not_meaningful in (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert not_meaningful in str(report)
    print_report(report)
    printed = " ".join(capsys.readouterr().out.split())
    assert "not meaningful" in printed
    assert "mAP over car (6), pedestrian (2)" in printed
    assert "No class has 50 evaluated boxes" in printed
