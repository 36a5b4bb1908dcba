"""Clouds, boxes, a drive and a detector for the tests of attacks."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import CLOCK, SCENARIO_INFO, TF_STATIC, VehicleTopics

sys.path.insert(0, str(Path(__file__).parent))

from linear_detector import BOX, LinearVoxelDetector

FRAMES, PERIOD_NS, EPOCH_NS = 6, 100_000_000, 1_700_000_000_000_000_000


def cloud_of(points):
    cloud = np.zeros(len(points), POINT_DTYPE)
    if len(points):
        cloud["x"], cloud["y"], cloud["z"] = np.asarray(points, dtype=np.float32).T
    return cloud


def car(*geometries):
    geometry = np.asarray(geometries, dtype=np.float64).reshape(-1, 7)
    return Boxes(
        geometry,
        np.zeros(len(geometry), np.int64),
        tuple(f"car{i}" for i in range(len(geometry))),
        np.zeros((len(geometry), 3)),
    )


@pytest.fixture
def make_cloud():
    return cloud_of


@pytest.fixture
def make_boxes():
    return car


@pytest.fixture
def make_detector():
    return LinearVoxelDetector


@pytest.fixture
def hand_worked():
    """Voxels of a car at (0..3, 0, 0): A holds 1 point and weighs 4, B 3 points and 6, C 2 points and 9.

    Gain per point: C 4.5, A 4, B 2. Four points of clutter lie outside the box, one outside the range.
    """
    a = [[0.5, 0.5, 0.5]]
    b = [[1.2, 0.5, 0.5], [1.5, 0.5, 0.5], [1.8, 0.5, 0.5]]
    c = [[2.4, 0.5, 0.5], [2.6, 0.5, 0.5]]
    clutter = [[6.5, 6.5, 6.5], [6.6, 6.5, 6.5], [8.5, 1.5, 0.5], [50.0, 0.5, 0.5]]
    weights = np.ones((10, 10, 10))
    weights[0, 0, 0], weights[1, 0, 0], weights[2, 0, 0] = 4, 6, 9
    box = [1.5, 0.5, 0.5, 3.0, 1.0, 1.0, 0.0]
    return cloud_of(clutter[:2] + b + a + c + clutter[2:]), car(box), LinearVoxelDetector(weights, [box])


@pytest.fixture
def clean_bag(tmp_path):
    """Six frames at 10 Hz, a car in each but frame 4; the clock at 50 Hz."""
    return write_drive(tmp_path / "clean")


def write_drive(path, frames=FRAMES):
    ego = VehicleTopics("ego")
    base_SE3_lidar = se3_from_yaw([0.5, 0.0, 1.8], 0.2)
    draw = np.random.default_rng(11)
    with BagWriter(path, provenance=clean_provenance("test", "simulation: {}\n", 7, "0" * 64)) as bag:
        static = [(ego.base_frame, ego.lidar_frame, base_SE3_lidar)]
        bag.write(TF_STATIC, build.transforms(EPOCH_NS, static), EPOCH_NS)
        bag.write(SCENARIO_INFO, build.string("{}"), EPOCH_NS)
        for frame in range(frames):
            stamp_ns = EPOCH_NS + frame * PERIOD_NS
            map_SE3_base = se3_from_yaw([10.0 + frame, 5.0, 0.0], 0.3)
            boxes = (car(BOX) if frame != 4 else car()).transformed(map_SE3_base @ base_SE3_lidar)
            cloud = cloud_of(draw.uniform(0, 10, (500 + frame, 3)))
            cloud["ring"], cloud["intensity"] = np.arange(len(cloud)) % 64, draw.random(len(cloud))
            bag.write(ego.objects, build.detections_message(stamp_ns, "map", boxes), stamp_ns)
            odometry = build.odometry(stamp_ns, map_SE3_base, [10.0, 0.0, 0.0], [0.0, 0.0, 0.0])
            bag.write(ego.true_odometry, odometry, stamp_ns)
            bag.write_cdr(ego.lidar_points, cloud_to_cdr(cloud, stamp_ns, ego.lidar_frame), stamp_ns)
            for tick in range(5):
                tick_ns = stamp_ns + tick * PERIOD_NS // 5
                bag.write(CLOCK, build.clock(tick_ns), tick_ns)
    return path
