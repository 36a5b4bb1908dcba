"""Attacks on detectors without `occupancy_loss`, with a gradient or without one."""

from __future__ import annotations

import numpy as np
import pytest
from framing_detector import ATTACKS, Centred, Framing, Sloped, framed_car, rng, strict_matches

from advpipe.pipeline.detector.protocol import ObjectDetector, VoxelDetector
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.messages.cloud import xyz
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.perturb import Perturb


@pytest.fixture
def scene(make_cloud, make_boxes):
    return framed_car(make_cloud, make_boxes)


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
    brightness = {}
    for intensity in (True, False):
        result = Attach(eps_m=0.5, points=30, intensity=intensity)(cloud, boxes, Framing(), rng())
        added = result.cloud["intensity"][len(cloud) :]
        assert ((added >= 0) & (added <= 1)).all()
        brightness[intensity] = added.mean()
    assert brightness[True] > brightness[False] + 0.02
