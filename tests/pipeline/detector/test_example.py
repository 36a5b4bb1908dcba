"""The example of a user's detector: boxes worked out by hand, and used by name from its folder."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics

EXAMPLE = Path(__file__).parents[3] / "examples" / "my_detector.py"
NAME = "my_detector:ClusterDetector"
CARS = np.array([[10.0, 3.0, -1.05, 4.4, 1.8, 1.5, 0.4], [-15.0, -6.0, -1.05, 4.8, 1.9, 1.5, 2.0]])
TOPICS = VehicleTopics("ego")


def cloud_of(boxes, seed=0):
    """The four walls of each box, a wall 12 m long, a post, and the road 1.8 m below the sensor."""
    rng = np.random.default_rng(seed)
    things = [np.column_stack([rng.uniform(-40, 40, (3000, 2)), np.full(3000, -1.8)])]
    wall = np.column_stack([rng.uniform(0, 12, 400), np.full(400, 20.0), rng.uniform(-1.4, 0.2, 400)])
    post = np.column_stack([rng.uniform(-0.1, 0.1, (60, 2)) + [5, -9], rng.uniform(-1.4, 0.2, 60)])
    for x, y, z, length, width, height, yaw in boxes:
        along, across = rng.uniform(-0.5, 0.5, (2, 600))
        along[:300], across[300:] = np.sign(along[:300]) / 2, np.sign(across[300:]) / 2
        u, v = along * length, across * width
        up = z + rng.uniform(-0.3, 0.5, 600) * height
        things.append(
            np.column_stack(
                [x + u * np.cos(yaw) - v * np.sin(yaw), y + u * np.sin(yaw) + v * np.cos(yaw), up]
            )
        )
    xyz = np.concatenate([*things, wall, post, [[np.nan, 0, 0]]])
    cloud = np.zeros(len(xyz), POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = xyz.T
    return cloud


@pytest.fixture
def detector(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE.parent))
    yield load_detector(NAME)
    sys.modules.pop("my_detector", None)


def test_the_example_has_at_most_the_documented_lines():
    code = [line for line in EXAMPLE.read_text().splitlines() if line.strip()]
    assert len(code) <= 42


def test_the_example_finds_only_cars(detector):
    found = detector.detect(cloud_of(CARS))
    assert len(found) == 2
    # The first is 0.1 m off the usual length, the second 0.3 m.
    np.testing.assert_allclose(found.scores, np.exp([-0.1, -0.3]), rtol=0.05)
    overlap = iou_3d(found.boxes, CARS)
    assert overlap.argmax(1).tolist() == [0, 1]
    assert overlap.max(1).min() > 0.8
    assert len(detector.detect(cloud_of(CARS)[:0])) == 0


def test_its_loss_rises_when_points_of_a_car_are_removed(detector):
    cloud = cloud_of(CARS)
    points = torch.tensor(np.stack([cloud[n] for n in ("x", "y", "z", "intensity")], 1)[:-1])
    boxes, labels = torch.tensor(CARS, dtype=torch.float32), torch.zeros(2, dtype=torch.int64)
    points.requires_grad_()
    loss = detector.loss(points, boxes, labels)
    (gradient,) = torch.autograd.grad(loss, points)
    gone = gradient.norm(dim=1).argsort(descending=True)[:200]
    left = torch.ones(len(points), dtype=torch.bool)
    left[gone] = False
    assert detector.loss(points[left], boxes, labels) > loss
    # It is largest at the cars (points 3,000 to 4,199), but for some of the road close beneath them.
    assert ((gone >= 3000) & (gone < 4200)).float().mean() > 0.9


def test_evaluate_loads_it_from_the_working_directory(tmp_path):
    shutil.copy(EXAMPLE, tmp_path)
    with BagWriter(tmp_path / "clean", provenance={"kind": "clean"}) as bag:
        for index in range(3):
            stamp_ns = 10**12 + index * 10**8
            cdr = cloud_to_cdr(cloud_of(CARS, index), stamp_ns, TOPICS.lidar_frame)
            bag.write_cdr(TOPICS.lidar_points, cdr, stamp_ns)
            truth = Boxes(CARS, np.zeros(2, np.int64), ("a", "b"), np.zeros((2, 3)))
            bag.write(TOPICS.objects, build.detections_message(stamp_ns, TOPICS.lidar_frame, truth), stamp_ns)
    program = "from advpipe.pipeline.cli import app; app()"
    arguments = ["evaluate", "clean", "--detector", NAME, "--workers", "1", "--out", "report"]
    command = [sys.executable, "-c", program]
    done = subprocess.run(command + arguments, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert json.dumps(NAME) in (tmp_path / "report" / "report.json").read_text()
    assert "car" in done.stdout
