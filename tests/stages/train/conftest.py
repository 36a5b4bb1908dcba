"""Small labelled drives in real bags, and a network small enough to learn them in seconds."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.second import presets
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics

sys.path.insert(0, str(Path(__file__).parent))

EGO = VehicleTopics("ego")
SIZES = np.array([[4.5, 1.85, 1.55], [5.4, 2.05, 2.3], [1.9, 0.75, 1.7], [0.8, 0.7, 1.75]])


def labelled_cloud(rng: np.random.Generator) -> tuple[np.ndarray, Boxes]:
    """Ground, and one object of each class in a quarter of its own, its faces covered with points."""
    labels = np.arange(4)
    quarter = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    centres = quarter * rng.uniform(3.0, 5.5, (4, 2))
    size = SIZES[labels] * rng.uniform(0.95, 1.05, (4, 3))
    yaw = rng.uniform(-np.pi, np.pi, 4)
    geometry = np.column_stack([centres, -1.8 + size[:, 2] / 2, size, yaw])
    parts = [np.column_stack([rng.uniform(-8, 8, (800, 2)), rng.normal(-1.8, 0.02, 800)])]
    for box in geometry:
        local = rng.uniform(-0.5, 0.5, (400, 3))
        face = rng.integers(0, 3, 400)
        local[np.arange(400), face] = np.sign(local[np.arange(400), face]) * 0.499
        local *= box[3:6]
        c, s = np.cos(box[6]), np.sin(box[6])
        parts.append(local @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + box[:3])
    xyz = np.concatenate(parts)
    cloud = np.zeros(len(xyz), POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = xyz.T
    cloud["intensity"] = rng.uniform(0, 1, len(xyz))
    ids = tuple(f"{label}" for label in labels)
    return cloud, Boxes(geometry, labels, ids, np.zeros((4, 3)))


def _record(path: Path, frames: int, seed: int, **about: str) -> Path:
    """A bag of such clouds; the boxes are stated in the LiDAR's own frame."""
    rng = np.random.default_rng(seed)
    with BagWriter(path, provenance={"kind": "clean", "seed": str(seed), **about}) as bag:
        for frame in range(frames):
            stamp_ns = 1_000_000_000 + frame * 100_000_000
            cloud, boxes = labelled_cloud(rng)
            bag.write_cdr(EGO.lidar_points, cloud_to_cdr(cloud, stamp_ns, EGO.lidar_frame), stamp_ns)
            bag.write(EGO.objects, build.detections_message(stamp_ns, EGO.lidar_frame, boxes), stamp_ns)
    return path


@pytest.fixture
def record() -> Callable[..., Path]:
    return _record


@pytest.fixture(scope="session")
def drive(tmp_path_factory) -> Path:
    return _record(tmp_path_factory.mktemp("drive") / "bag", frames=6, seed=1)


@pytest.fixture
def tiny(monkeypatch) -> str:
    """`small` over a sixth of the width, as a preset of its own."""
    preset = replace(presets.SMALL, name="tiny", range_m=Range(-8.0, -8.0, -3.1, 8.0, 8.0, 2.3))
    monkeypatch.setitem(presets.PRESETS, "tiny", preset)
    return "tiny"
