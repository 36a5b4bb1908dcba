"""The files of docs/extending.md that wrap models of OpenPCDet and MMDetection3D, run with stand-ins."""

from __future__ import annotations

import sys

import blocks
import numpy as np
import pytest
import stand_ins
import torch

from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.protocol import ObjectDetector, Range
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import cloud_of_xyzi
from advpipe.stages.attack.lidar.detach import Detach

FILES = {block.file_name: block.text for block in blocks.ALL if block.page == "docs/extending.md"}
NAMES = ("pcdet_model:PcdetModel", "mmdet3d_model:Mmdet3dModel")
CAR, PEDESTRIAN, BESIDE = stand_ins.ANCHORS[:, :7]


@pytest.fixture
def files(tmp_path, monkeypatch):
    """The files in a folder of modules."""
    stand_ins.install(monkeypatch)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("pcdet_model.py", "mmdet3d_model.py"):
        (tmp_path / name).write_text(FILES[name], encoding="utf-8")
    yield tmp_path
    for name in ("pcdet_model", "mmdet3d_model"):
        sys.modules.pop(name, None)


@pytest.fixture(params=NAMES)
def detector(files, request):
    return load_detector(request.param)


@pytest.fixture
def points():
    """A car, a pedestrian, ground in view, and a car beside the view."""
    draw = np.random.default_rng(1)
    parts = [draw.normal(box[:3].numpy(), 0.5, (60, 3)) for box in (CAR, PEDESTRIAN, BESIDE)]
    parts.append(draw.uniform((1, -20, -1.8), (39, 20, -1.7), (200, 3)))
    xyz = np.concatenate(parts)
    return torch.tensor(np.column_stack([xyz, draw.uniform(0, 1, len(xyz))]), dtype=torch.float32)


def test_each_has_at_most_sixty_lines():
    for name in ("pcdet_model.py", "mmdet3d_model.py"):
        assert 40 < sum(bool(line.strip()) for line in FILES[name].splitlines()) <= 60


def test_it_detects_what_is_in_view(detector, points):
    assert isinstance(detector, ObjectDetector)
    assert detector.classes == ("car", "pedestrian", "cyclist")
    assert detector.range_m == Range(*stand_ins.RANGE_M)
    Adaptation(lidar_height_m=2.0).check(detector, "mine")
    found = detector.detect(cloud_of_xyzi(torch.cat([points, torch.full((1, 4), torch.nan)]).numpy()))
    assert np.diff(found.scores).max() <= 0
    assert found.scores.min() > 0.5
    order = found.labels.argsort()
    np.testing.assert_allclose(found.boxes[order], torch.stack([CAR, PEDESTRIAN]).numpy(), atol=1e-6)


def test_its_loss_reaches_the_points(detector, points):
    """Finite differences at the points of steepest slope; none at points beyond the view."""
    boxes, labels = torch.stack([CAR, PEDESTRIAN, BESIDE]), torch.tensor([0, 1, 0])
    leaf = points.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(detector.loss(leaf, boxes, labels), leaf)
    beyond = points[:, 0] <= points[:, 1].abs()
    assert beyond.sum() > 60
    assert not gradient[beyond].any()
    assert detector.loss(points[~beyond], boxes[:2], labels[:2]) == detector.loss(points, boxes, labels)
    for row in gradient[:, :3].norm(dim=1).argsort(descending=True)[:3].tolist():
        step = torch.zeros_like(points)
        step[row, :3] = 0.01 * gradient[row, :3] / gradient[row, :3].norm()
        change = detector.loss(points + step, boxes, labels) - detector.loss(points - step, boxes, labels)
        assert float(change) / 0.02 == pytest.approx(float(gradient[row, :3].norm()), rel=0.05)


def test_an_attack_hides_what_it_finds(detector, points):
    cloud = cloud_of_xyzi(points.numpy())
    boxes = Boxes(CAR[None].double().numpy(), np.zeros(1, np.int64), ("car",), np.zeros((1, 3)))
    result = Detach(ratio=0.14)(cloud, boxes, detector, np.random.default_rng(0))
    before, after = (each.scores[each.labels == 0] for each in map(detector.detect, (cloud, result.cloud)))
    assert after < 0.5 < before
    assert result.loss_after > result.loss_before
