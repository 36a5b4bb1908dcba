"""Ensembles: what members see and find together, and the gradient of their joint voxels."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.adapted import detector_for_cloud
from advpipe.pipeline.detector.attacked import (
    attacked_name,
    attacked_sha256,
    attacked_slug,
    load_attacked,
)
from advpipe.pipeline.detector.ensemble import (
    DetectorEnsemble,
    EnsembleDetections,
    VoxelEnsemble,
    ensemble_of,
)
from advpipe.pipeline.detector.expected_input import ExpectedInput
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, Range, VoxelDetector
from advpipe.pipeline.detector.registry import detector_sha256, load_detector, member_names
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

sys.path.insert(0, str(Path(__file__).parent))

from families import HALF_M, small_detector

CAR, FAR_CAR = [3.0, 1.0, -1.0, 4.0, 2.0, 1.6, 0.3], [60.0, 0.0, -1.0, 4.0, 2.0, 1.6, 0.0]


class Fixed:
    """Detects what it is given; its loss is the sum of its boxes' x and labels, times the points' mean x."""

    def __init__(self, classes, half_m, boxes=(), scores=(), labels=(), height_m=1.8):
        self.classes, self.range_m = classes, Range(-half_m, -half_m, -3.0, half_m, half_m, 1.0)
        boxes = np.array(boxes, np.float64).reshape(-1, 7)
        self.found = Detections(boxes, np.array(scores, float), np.array(labels, np.int64))
        self.expected_input = ExpectedInput(height_m)

    def detect(self, cloud):
        return self.found

    def loss(self, points, boxes, labels):
        return (boxes[:, 0].sum() + labels.sum()) * points[:, 0].mean()


@pytest.fixture
def pair():
    """One knows cars and people nearby, the other cyclists and cars, farther too."""
    near = Fixed(("car", "pedestrian"), 20, [CAR, FAR_CAR], [0.9, 0.2], [0, 1])
    wide = Fixed(("cyclist", "car"), 80, [CAR], [0.95], [1], height_m=0.0)
    return ensemble_of([near, wide])


def test_it_covers_what_its_members_cover(pair):
    assert type(pair) is DetectorEnsemble
    assert isinstance(pair, ObjectDetector)
    assert pair.classes == ("car", "pedestrian", "cyclist")
    assert pair.range_m == Range(-80, -80, -3, 80, 80, 1)


def test_detections_keep_their_member(pair):
    found = pair.detect(None)
    assert found.scores.tolist() == [0.95, 0.9, 0.2]
    assert found.labels.tolist() == [0, 0, 1]
    assert found.member.tolist() == [1, 0, 0]
    first, second = found.of_members()
    assert (first.scores.tolist(), second.scores.tolist()) == ([0.9, 0.2], [0.95])
    merged = found.merged()
    assert merged.scores.tolist() == [0.95, 0.2]  # one car, though two members find it
    assert not isinstance(merged, EnsembleDetections)
    nothing = EnsembleDetections.joined(
        [Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))] * 2
    )
    assert [len(each) for each in nothing.of_members()] == [0, 0]
    assert len(nothing.merged()) == 0


def test_each_member_gets_the_boxes_that_it_knows(pair):
    """The near one: the car at 3 m, label 0. The wide one: both cars, label 1, and the cyclist, 0."""
    points = torch.ones(5, 4, requires_grad=True)
    boxes, labels = torch.tensor([CAR, FAR_CAR, FAR_CAR]), torch.tensor([0, 0, 2])
    loss = pair.loss(points, boxes, labels)
    assert float(loss.detach()) == pytest.approx((3 + (3 + 60 + 60 + 2)) / 2)
    (gradient,) = torch.autograd.grad(loss, points)
    assert gradient[:, 0].tolist() == pytest.approx([64 / 5] * 5)


def test_each_member_is_adapted_by_itself(pair):
    """At a LiDAR 2 m up, the one expects clouds 0.2 m higher, the other 2 m."""
    adapted, note = detector_for_cloud(
        pair, Adaptation(lidar_height_m=2.0), np.zeros((0, 3), np.float32), pair
    )
    assert note == ""
    first, second = adapted.detect(cloud_of_xyzi(np.zeros((0, 4), np.float32))).of_members()
    assert (first.boxes[0, 2], second.boxes[0, 2]) == (pytest.approx(-1.2), pytest.approx(-3.0))


@pytest.fixture(scope="module")
def networks():
    return [small_detector("pointpillars"), small_detector("centerpoint")]


@pytest.fixture(scope="module")
def scene():
    draw = np.random.default_rng(4)
    points = draw.uniform((-HALF_M, -HALF_M, -2, 0), (HALF_M, HALF_M, 0, 1), (150, 4))
    points[:60, :3] = draw.uniform((1, 0, -1.8), (5, 2, -0.2), (60, 3))
    points[-1, 0] = 50.0  # out of range
    probes = draw.uniform((0, -1, -2, 0), (6, 3, 0, 1), (80, 4))
    return torch.tensor(points, dtype=torch.float32), torch.tensor(probes, dtype=torch.float32)


def test_networks_of_two_families_share_joint_voxels(networks, scene):
    """Each point's gradient, worked out point by point from those of the members."""
    points, probes = scene
    ensemble = ensemble_of(networks)
    assert isinstance(ensemble, VoxelEnsemble)
    assert isinstance(ensemble, VoxelDetector)
    assert ensemble.voxel_grid == networks[1].voxel_grid  # the finer one
    boxes, labels = torch.tensor([CAR]), torch.tensor([0])
    leaf = points.clone().requires_grad_()
    computed = ensemble.occupancy_loss(leaf, boxes, labels, probes)
    alone = [each.occupancy_loss(leaf, boxes, labels, probes) for each in networks]
    assert float(computed.loss.detach()) == pytest.approx(
        np.mean([float(each.loss.detach()) for each in alone]), rel=1e-6
    )
    to_cells, to_points = torch.autograd.grad(computed.loss, [computed.occupancy, leaf])

    row = computed.rows.tolist()
    assert row[len(points) - 1] == -1
    pairs = list(zip(*(each.rows.tolist() for each in alone), strict=True))
    held = {pairs[n] for n in range(len(points)) if row[n] >= 0}
    assert len({row[n] for n in range(len(points)) if row[n] >= 0}) == len(held)
    for cell, occupied in enumerate(computed.occupancy.tolist()):
        assert occupied == (pairs[row.index(cell)] in held)
    expected, sizes, expected_points = np.zeros(len(to_cells)), [], torch.zeros_like(points)
    for member, each in enumerate(alone):
        gradient, of_points = torch.autograd.grad(each.loss, [each.occupancy, leaf])
        own = np.zeros(len(to_cells))
        for cell in range(len(own)):
            pair = pairs[row.index(cell)]
            sharing = [other for other in held if other[member] == pair[member]]
            if pair[member] < 0 or (pair not in held and sharing):
                continue
            own[cell] = float(gradient[pair[member]]) / (len(sharing) if pair in held else 1)
        sizes.append(np.abs(own).mean())
        expected += own / sizes[-1] / 2
        expected_points += of_points / sizes[-1] / 2
    assert min(sizes) > 0
    np.testing.assert_allclose(to_cells.numpy(), expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(to_points.numpy(), expected_points.numpy(), rtol=1e-4, atol=1e-5)


def test_one_pass_tells_what_the_members_find(networks, scene):
    points, _ = scene
    ensemble = ensemble_of(networks)
    with torch.no_grad():
        computed = ensemble.occupancy_loss(points, torch.tensor([CAR]), torch.tensor([0]))
    assert not computed.loss.requires_grad
    found = ensemble.detect(cloud_of_xyzi(points.numpy()))
    assert len(found)
    assert computed.found.member.tolist() == found.member.tolist()
    np.testing.assert_allclose(computed.found.scores, found.scores, rtol=1e-3)
    nowhere = torch.full((3, 4), 99.0)
    empty = ensemble.occupancy_loss(nowhere, torch.tensor([CAR]), torch.tensor([0]))
    assert empty.rows.tolist() == [-1, -1, -1]
    assert len(empty.occupancy) == 0


def test_a_mixed_ensemble_reads_no_voxels(networks, pair):
    assert type(ensemble_of([networks[0], pair.members[0]])) is DetectorEnsemble


def test_names(tmp_path):
    file = tmp_path / "a,b.safetensors"
    other = tmp_path / "c.txt"
    file.touch()
    other.touch()
    assert member_names(str(file)) == [str(file)]
    assert member_names("small, runs/b.safetensors") == ["small", "runs/b.safetensors"]
    assert attacked_name(f"small,{tmp_path}/b.safetensors") == "small,b.safetensors"
    assert attacked_slug(f"small,{tmp_path}/b.safetensors") == "small+b"
    assert attacked_sha256(f"small,{file.parent}/c.txt") == f"{detector_sha256('small')},{sha256_of(other)}"
    with pytest.raises(UsageError, match="ensemble 'small, small' names 'small' twice"):
        load_attacked("small, small")
    with pytest.raises(UsageError, match="unknown detector"):
        load_attacked("small,")
    with pytest.raises(UsageError, match="is an ensemble, which attacks alone take; give one detector here"):
        load_detector("small,other.safetensors")
