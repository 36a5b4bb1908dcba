"""Quantities of a changed cloud, worked out by hand, and bounds that hold and that do not."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.labels.quantities import CLOUD_QUANTITIES
from advpipe.pipeline.labels.quantity import excesses
from advpipe.pipeline.messages.cloud import POINT_DTYPE

CLEAN = np.zeros(100, POINT_DTYPE)
CLEAN["x"] = np.arange(100)


def labels(points: list[int], actions: list[str]) -> PointLabels:
    return PointLabels(np.array(points, np.int64), np.array(actions, np.str_), np.zeros(len(points)))


def changed() -> CloudChange:
    """The points 1 and 3 are removed, 2 and 5 moved by 3 and 4 m, one stands 0.5 m behind the last one."""
    adversarial = np.delete(CLEAN, [1, 3])
    adversarial["y"][1] = 3.0
    adversarial["z"][3] = -4.0
    adversarial["intensity"][3] = 0.25
    added = CLEAN[-1:].copy()
    added["x"] += 0.5
    stated_labels = labels([1, 2, 3, 5, -1], ["removed", "moved", "removed", "moved", "added"])
    return CloudChange(CLEAN, np.concatenate([adversarial, added]), stated_labels)


def test_measures() -> None:
    """Two of 100 points are what a share of 1.5 % rounds to, and no smaller one."""
    change = changed()
    assert {name: quantity.measure(change) for name, quantity in CLOUD_QUANTITIES.items()} == {
        "max_displacement_m": 4.0,
        "mean_square_displacement_m2": (9 + 16) / 2,
        "max_added_distance_m": 0.5,
        "max_intensity_change": 0.25,
        "max_off_ray_urad": pytest.approx(1e6 * np.arctan2(3, 2)),
        "points_moved": 2,
        "points_added": 1,
        "points_removed": 2,
        "points_touched": 4,
        "share_removed": 0.015,
    }


def test_nothing_changed_measures_nothing() -> None:
    change = CloudChange(CLEAN, CLEAN, labels([], []))
    assert {quantity.measure(change) for quantity in CLOUD_QUANTITIES.values()} == {0}


@pytest.mark.parametrize(
    ("bounds", "said"),
    [
        ({"max_displacement_m": (0.0, 4.0), "points_added": (1, 1)}, []),
        (
            {"max_displacement_m": (0.0, 3.9)},
            ["largest displacement of a point: 4 m, but the attack declares 0 to 3.9 m"],
        ),
        ({"points_added": (3, 3)}, ["points added: 1, but the attack declares 3 (points_added)"]),
        ({"share_removed": (0.0, 0.015)}, []),
        (
            {"share_removed": (0.0, 0.0149)},
            ["smallest share of the points that rounds to the number removed: 0.015"],
        ),
        (
            {"max_added_distance_m": (0.0, 0.5), "max_intensity_change": (0.0, 0.2)},
            ["largest change of an intensity"],
        ),
    ],
)
def test_bounds(bounds: dict[str, tuple[float, float]], said: list[str]) -> None:
    found = list(excesses(changed(), bounds, CLOUD_QUANTITIES))
    assert len(found) == len(said)
    assert all(line.startswith(start) for line, start in zip(found, said, strict=True))


def test_one_point_may_always_go() -> None:
    """The share of 0.1 % of 100 points is none, and one is removed at least."""
    change = CloudChange(CLEAN, CLEAN[1:], labels([0], ["removed"]))
    assert list(excesses(change, {"share_removed": (0.0, 0.001)}, CLOUD_QUANTITIES)) == []
