"""Rows that were written as JSON come back as they were."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from advpipe.pipeline.results.deprecated import with_new_keys
from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.stored import stored_row

CELLS = sorted((Path(__file__).parents[3] / "datasets" / "reports").glob("*/cells/*.json"))


NEWER = ("map_loose_ratio_ci95", "points_off_ray", "at_face_percent", "at_face_clean_percent")
"""Keys of metrics that the committed sweeps are too old to have."""

NEWEST = "map_loose_ratio_delta_points_vs_"
"""What further keys begin with that they are too old to have."""


def records() -> list[dict[str, Any]]:
    """Those of the committed sweeps: of every attack, and with every baseline."""
    return [with_new_keys(json.loads(path.read_text())["row"], path.parent) for path in CELLS]


def test_committed_rows_are_written_as_they_were_read() -> None:
    assert {record["attack"] for record in records()} == {"perturb", "detach", "attach"}
    for record in records():
        written = plain_value(stored_row(record).record())
        newer = {key for key in written if key not in record}
        newest = {key for key in newer if key.startswith(NEWEST)}
        assert all(written[key] is None for key in newer)
        assert all(key.endswith(NEWER) for key in newer - newest)
        assert {key: value for key, value in written.items() if key not in newer} == record


def test_a_row_without_an_attack_has_no_figures_of_one() -> None:
    clean = records()[0] | {"points_added": None, "baselines": []}
    row = stored_row(clean)
    assert (row.attacked, row.recounted, row.baselines) == (None, None, {})
    assert row.clean.precisions.ap["strict", "car"] == clean["ap_car_clean"]


@pytest.mark.parametrize(
    "spoilt",
    [
        {"map_adv": "much"},
        {"points_moved": 1.5},
        {"map_ratio_ci95": [1.0]},
        {"baselines": ["baseline_of_mine"]},
    ],
)
def test_what_is_no_row_is_refused(spoilt: dict[str, Any]) -> None:
    with pytest.raises((KeyError, TypeError, ValueError)):
        stored_row(records()[0] | spoilt)
