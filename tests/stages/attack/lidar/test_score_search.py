"""Attacks on detectors without `occupancy_loss`, with a gradient or without one."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, Range, VoxelDetector
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.messages.cloud import xyz, xyzi
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb

BOX = np.array([5.0, 5.0, 1.0, 4.0, 2.0, 1.6, 0.3])


class Framing:
    """Fits a box to the points that stand above the ground, as wide as they are: what is cut off or added at
    an end shortens or lengthens it. Its loss is a plain number, so that scores are all that it tells."""

    classes, range_m = ("car",), Range(0.0, 0.0, 0.0, 10.0, 10.0, 3.0)
    looks = 0

    def detect(self, cloud):
        self.looks += 1
        cos, sin = np.cos(BOX[6]), np.sin(BOX[6])
        box_R = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        place = (xyz(cloud).astype(float) - BOX[:3]) @ box_R
        mine = place[(np.abs(place) <= BOX[3:6] / 2 + 0.6).all(axis=1)]
        if not len(mine):
            return Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))
        low, high = self.faces_m(mine)
        found = np.concatenate([BOX[:3] + box_R @ ((low + high) / 2), np.maximum(high - low, 0.1), BOX[6:]])
        brightness = 0.2 * (1 - np.clip(xyzi(cloud)[:, 3].mean(), 0, 1))
        score = np.clip(0.5 + 0.3 * np.exp(-np.abs(high - low - BOX[3:6]).sum()) + brightness, 0, 1)
        return Detections(found[None], np.array([score]), np.zeros(1, np.int64))

    def faces_m(self, points):
        return points.min(axis=0), points.max(axis=0)

    def loss(self, points, boxes, labels):
        return torch.tensor(1.0)


class Centred(Framing):
    """Puts a box of the right size about the mean of the points, which scattering them hardly moves."""

    def faces_m(self, points):
        return points.mean(axis=0) - BOX[3:6] / 2, points.mean(axis=0) + BOX[3:6] / 2


class Sloped(Framing):
    """With a gradient, which leads nowhere."""

    def loss(self, points, boxes, labels):
        return (points[:, :3] * torch.arange(1.0, 1.0 + len(points))[:, None]).sum()


@pytest.fixture
def scene(make_cloud, make_boxes):
    draw = np.random.default_rng(2)
    on_car = draw.uniform(-0.5, 0.5, (300, 3)) * BOX[3:6]
    cos, sin = np.cos(BOX[6]), np.sin(BOX[6])
    on_car = on_car @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]).T + BOX[:3]
    cloud = make_cloud(np.concatenate([on_car, draw.uniform([0, 7.5, 0], [10, 10, 0.1], (300, 3))]))
    cloud["intensity"] = 0.5
    return cloud, make_boxes(BOX)


def strict_matches(detector, cloud, boxes):
    """How many objects the detector still finds at strict overlap."""
    return int((iou_3d(detector.detect(cloud).boxes, boxes.geometry) >= 0.7).sum())


ATTACKS = {
    "perturb": lambda **options: Perturb(eps_cm=30, **options),
    "detach": lambda **options: Detach(ratio=0.4, **options),
    "attach": lambda **options: Attach(eps_m=0.5, points=30, **options),
}


def rng(seed=0):
    return named_generator(seed, "test")


@pytest.mark.parametrize(
    ("name", "made"),
    [("perturb", Centred), *((name, made) for name in ("detach", "attach") for made in (Framing, Sloped))],
)
def test_it_beats_random_best_at_equal_tries_without_a_gradient_that_helps(scene, name, made):
    detector = made()
    assert isinstance(detector, ObjectDetector)
    assert not isinstance(detector, VoxelDetector)
    assert strict_matches(detector, *scene) == 1
    still_found = {}
    for recipe in ("best", "random-best"):
        attack, still_found[recipe] = ATTACKS[name](recipe=recipe), 0
        for seed in range(4):
            detector.looks = 0
            result = attack(*scene, detector, rng(seed))
            # The clean cloud at most three times, and the adversarial one, are no candidates.
            assert detector.looks <= attack.query_budget + 4
            assert ("occupancy_loss" in result.note) == (recipe == "best")
            assert "no gradient" not in result.note
            still_found[recipe] += strict_matches(detector, result.cloud, scene[1])
    assert still_found["best"] <= still_found["random-best"] - 2


@pytest.mark.parametrize("recipe", ["best", "robust"])
@pytest.mark.parametrize("name", ATTACKS)
def test_same_generator_same_cloud(scene, name, recipe):
    first, second = (ATTACKS[name](recipe=recipe)(*scene, Sloped(), rng(3)) for _ in range(2))
    assert first.cloud.tobytes() == second.cloud.tobytes()
    assert len(first.labels)


def test_moved_points_keep_the_bounds_and_constraints(scene):
    cloud, boxes = scene
    attack = Perturb(eps_cm=10, max_points=150, along_ray=True, steps=6)
    result = attack(cloud, boxes, Sloped(), rng())
    offset = xyz(result.cloud).astype(float) - xyz(cloud)
    length_m = np.linalg.norm(offset, axis=1)
    assert 0 < (length_m > 0).sum() <= 150
    assert length_m.max() <= 0.1
    ray = xyz(cloud).astype(float) / np.linalg.norm(xyz(cloud).astype(float), axis=1, keepdims=True)
    assert np.linalg.norm(np.cross(offset, ray), axis=1).max() < 1e-5
    (near,) = points_in_boxes(xyz(cloud), boxes.geometry, attack.settings.margin_m)
    assert np.isin(result.labels.point, near).all()
    assert (result.cloud["intensity"] == cloud["intensity"]).all()


def test_intensities_are_attacked_on_demand(scene):
    cloud, boxes = scene
    cloud["intensity"] = np.linspace(0, 1, len(cloud))
    result = Perturb(eps_cm=0, intensity=True)(cloud, boxes, Framing(), rng())
    assert result.cloud["intensity"].mean() > cloud["intensity"].mean() + 0.02  # brighter: a lower score
    assert (xyz(result.cloud) == xyz(cloud)).all()
    for intensity, least in ((True, 10), (False, 0)):
        result = Attach(eps_m=0.5, points=30, intensity=intensity)(cloud, boxes, Framing(), rng())
        added = result.cloud["intensity"][len(cloud) :]
        assert ((added >= 0) & (added <= 1)).all()
        assert (~np.isin(added, cloud["intensity"])).sum() >= least
        assert intensity or np.isin(added, cloud["intensity"]).all()
