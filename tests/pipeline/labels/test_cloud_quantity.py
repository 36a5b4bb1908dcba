"""Columns and aggregates of a changed cloud, worked out by hand, and what a bag may declare."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.cloud_quantity import AGGREGATES, COLUMNS, CloudQuantity
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.labels.quantities import MAX_DISPLACEMENT, cloud_quantities
from advpipe.pipeline.messages.cloud import POINT_DTYPE


def declared(column: str, aggregate: str, name: str = "mine") -> CloudQuantity:
    return CloudQuantity(name=name, unit="m", meaning="my quantity", column=column, aggregate=aggregate)


@pytest.fixture(scope="module")
def change() -> CloudChange:
    """Of 10 points along x, the first is removed, two are moved by (3, -4, 12) and (0, 0, 1) m, one of them
    shines 0.5 brighter, and a point is added 2 m from the last."""
    clean = np.zeros(10, POINT_DTYPE)
    clean["x"] = 10 * np.arange(10)
    adversarial = np.append(clean[1:], clean[-1:])
    for name, offset_m in (("x", 3), ("y", -4), ("z", 12)):
        adversarial[name][0] += offset_m
    adversarial["z"][1] += 1
    adversarial["intensity"][1] = 0.5
    adversarial["y"][-1] = 2
    labels = PointLabels(
        np.array([0, 1, 2, -1]),
        np.array(["removed", "moved", "moved", "added"]),
        np.array([np.nan, 13.0, 1.0, 2.0]),
    )
    return CloudChange(clean, adversarial, labels)


def test_columns(change: CloudChange) -> None:
    assert {name: column(change).tolist() for name, column in COLUMNS.items()} == {
        "displacement_m": [13, 1],
        "x_displacement_m": [3, 0],
        "y_displacement_m": [4, 0],
        "z_displacement_m": [12, 1],
        "xy_displacement_m": [5, 0],
        "off_ray_urad": pytest.approx([1e6 * np.arctan2(np.hypot(4, 12), 13), 1e6 * np.arctan2(1, 20)]),
        "intensity_change": [0, 0.5],
        "added_distance_m": [2],
        "moved": [1, 1],
        "added": [1],
        "removed": [1],
        "touched": [1, 1, 1],
    }


@pytest.mark.parametrize(
    ("aggregate", "value"), [("max", 13), ("mean", 7), ("mean_square", 85), ("sum", 14), ("share", 1.4)]
)
def test_aggregates(change: CloudChange, aggregate: str, value: float) -> None:
    assert declared("displacement_m", aggregate).measured(change) == value


def test_an_untouched_cloud_is_0_in_all(change: CloudChange) -> None:
    none = PointLabels.removed(np.zeros(0, np.int64))
    untouched = CloudChange(change.clean, change.clean, none)
    values = {declared(column, each).measured(untouched) for column in COLUMNS for each in AGGREGATES}
    assert values == {0.0}


def test_what_this_version_cannot_measure_is_left_out() -> None:
    """And the name of a shared quantity is that quantity, whatever a bag says."""
    newer = [declared("curl", "max", "curl"), declared("moved", "mode", "mode")]
    hidden = declared("removed", "max", MAX_DISPLACEMENT.name)
    known = cloud_quantities([*newer, hidden, declared("moved", "share")])
    assert {"curl", "mode"}.isdisjoint(known)
    assert known["mine"].meaning == "my quantity"
    assert known[MAX_DISPLACEMENT.name].meaning == MAX_DISPLACEMENT.meaning


def test_a_declaration_carries_it_as_plain_data() -> None:
    written = Declaration(family="lidar", bounds={"mine": (0, 1)}, quantities=(declared("moved", "sum"),))
    plain = written.plain()
    assert plain["quantities"] == [
        {"name": "mine", "unit": "m", "meaning": "my quantity", "column": "moved", "aggregate": "sum"}
    ]
    assert Declaration.model_validate(plain) == written
