"""Added points stand where the sensor would have written them, and labels, table and checks know where."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.attack_detection.coordinate_grid import CoordinateGrid
from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.clouds import LabelledFrame, PointTables, read_point_labels
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.messages.cloud import POINT_DTYPE, StampedCloud, xyz
from advpipe.stages.attack.job import open_job
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.base import LidarResult
from advpipe.stages.attack.lidar.perturb import Perturb
from advpipe.stages.attack.lidar.scan_placement import in_scan_order
from advpipe.stages.verify.checks.points import label_differences

RINGS, COLUMNS = 8, 90


def turn(draw, grid_m=0.0):
    """Column by column, clockwise from behind; a fifth of the rays return nothing."""
    column, ring = (each.ravel() for each in np.mgrid[:COLUMNS, :RINGS])
    azimuth, elevation = np.pi - column * 2 * np.pi / COLUMNS, np.deg2rad(-15 + 2.0 * ring)
    range_m = draw.uniform(3, 30, len(column))
    cloud = np.zeros(len(column), POINT_DTYPE)
    flat = range_m * np.cos(elevation)
    places = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), range_m * np.sin(elevation)])
    places = np.rint(places / grid_m) * grid_m if grid_m else places
    cloud["x"], cloud["y"], cloud["z"] = places.T
    cloud["ring"], cloud["time"] = ring, (column - COLUMNS + 1) / COLUMNS / 10
    cloud["intensity"] = draw.random(len(cloud))
    return cloud[draw.random(len(cloud)) > 0.2]


def key(cloud):
    azimuth = np.arctan2(cloud["y"].astype(float), cloud["x"].astype(float))
    return np.rint((np.pi - azimuth) / (2 * np.pi) * COLUMNS) % COLUMNS * RINGS + cloud["ring"]


@pytest.fixture
def attached(make_boxes, make_detector):
    draw = np.random.default_rng(4)
    clean = turn(draw)
    attack = Attach(recipe="random", eps_m=0.5, points=25)
    detector = make_detector(np.ones((10, 10, 10)), [[5.0, 5.0, 5.0, 3.0, 1.0, 1.0, 0.0]])
    return clean, attack(clean, make_boxes(), detector, draw)


def test_added_points_stand_in_the_scan_with_its_rings_and_times(attached) -> None:
    clean, result = attached
    assert (result.cloud[-25:] == result.cloud[result.labels.places(len(clean))]).all()
    placed = in_scan_order(clean, result)
    change = CloudChange(clean, placed.cloud, placed.labels)
    assert not list(label_differences(change))
    assert (np.diff(key(placed.cloud)) >= 0).all()
    added = change.added
    assert sorted(added.tolist()) == sorted(result.cloud[-25:].tolist())
    elevation = np.rad2deg(np.arctan2(added["z"], np.hypot(added["x"], added["y"])))
    assert (added["ring"] == np.clip(np.rint((elevation + 15) / 2), 0, RINGS - 1)).all()
    column = key(added) // RINGS
    assert np.abs(added["time"] - (column - COLUMNS + 1) / COLUMNS / 10).max() < 1e-6


def test_the_table_and_the_job_keep_the_places(attached, tmp_path) -> None:
    clean, result = attached
    placed = in_scan_order(clean, result)
    with PointTables(tmp_path) as tables:
        frame = LabelledFrame("/l", 0, "attach", StampedCloud(7, "f", clean), len(placed.cloud))
        tables.add(frame, placed.labels)
    (read,) = read_point_labels(tmp_path / "labels.parquet")
    assert (read.labels.attacked == placed.labels.attacked).all()
    assert (placed.cloud[read.labels.attacked] == placed.cloud[placed.labels.attacked]).all()
    with open_job(tmp_path / "out", "request") as job:
        job.store(0, placed)
        assert (job.require(0).labels.attacked == placed.labels.attacked).all()
        job.store(1, result)
        assert job.require(1).labels.attacked is None


def test_moved_removed_and_added_points_at_once() -> None:
    """A user's own attack may do all three."""
    draw = np.random.default_rng(9)
    clean = turn(draw)
    moved, removed = np.array([3, 200, 401]), np.array([10, 202, 203])
    cloud = clean.copy()
    cloud["x"][moved] += 0.25
    added = clean[[5, 100, 300, 300]].copy()
    added["z"] += 0.125
    labels = PointLabels(
        np.concatenate([moved, removed, [-1] * 4]),
        np.array(["moved"] * 3 + ["removed"] * 3 + ["added"] * 4),
        np.array([0.25] * 3 + [np.nan] * 3 + [0.125] * 4),
    )
    plain = LidarResult(np.concatenate([np.delete(cloud, removed), added]), labels)
    assert not list(label_differences(CloudChange(clean, plain.cloud, labels)))
    placed = in_scan_order(clean, plain)
    change = CloudChange(clean, placed.cloud, placed.labels)
    assert not list(label_differences(change))
    assert (change.moved[1] == cloud[moved]).all()
    assert (change.added == added).all()
    assert (placed.labels.attacked[:3] != labels.places(len(clean))[:3]).any()


@pytest.mark.parametrize(
    ("place", "fault"),
    [(5, "twice"), (10_000, "does not have"), (0, "moved, or were moved without a label")],
)
def test_false_places_are_found(attached, place: int, fault: str) -> None:
    clean, result = attached
    placed = in_scan_order(clean, result)
    assert placed.labels.attacked is not None
    placed.labels.attacked[:2] = place if place else placed.labels.attacked[1::-1] + 1
    assert any(fault in found for found in label_differences(CloudChange(clean, placed.cloud, placed.labels)))


@pytest.mark.parametrize("attack", [
    Perturb(recipe="random", eps_cm=5),
    Attach(recipe="random", eps_m=0.5, points=25),
])  # fmt: skip
def test_points_stay_on_the_grid_of_the_sensor(attack, make_boxes, make_detector) -> None:
    draw = np.random.default_rng(4)
    clean = turn(draw, 2.0**-9)
    detector = make_detector(np.ones((10, 10, 10)), [[5.0, 5.0, 5.0, 3.0, 1.0, 1.0, 0.0]])
    result = attack(clean, make_boxes(), detector, draw)
    assert len(result.labels) >= 25
    grid = CoordinateGrid.learnt(clean)
    assert grid == CoordinateGrid(2.0**-9)
    assert (grid.offset_m(xyz(result.cloud)) == 0).all()
    assert CloudChange(clean, result.cloud, result.labels).displacement_m.max(initial=0) <= 0.05
