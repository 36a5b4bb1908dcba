"""The search for a texture: its gradient, and that it beats random ones."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from camera_scenes import scene
from red_detector import RedDetector

from advpipe.pipeline.sensors.camera.exposure import levels_of, signal_of
from advpipe.stages.attack.camera.patch_light import PatchLight
from advpipe.stages.attack.camera.patch_place import PatchSize, VehicleRear
from advpipe.stages.attack.camera.patch_print import PatchImage, reflectance
from advpipe.stages.attack.camera.patch_search import PatchExample, PatchExamples, best_random, optimised
from advpipe.stages.attack.camera.patch_view import patch_view

REAR, TEXELS = VehicleRear("van", PatchSize(1.6, 1.2), 1.0), (6, 8)
BOX_PX = (280.0, 220.0, 359.0, 299.0)


@pytest.fixture(scope="module")
def examples() -> PatchExamples:
    """A red van, with the patch where it is and a little aside."""
    ahead = scene()
    rgb = np.full((480, 640, 3), 128, np.uint8)
    rgb[ahead.pixels_of("van")] = (180, 60, 60)
    signal = signal_of(rgb).reshape(-1, 3)
    light = PatchLight(np.array([0.8, 0.78, 0.7]), np.array([0.01, 0.01, 0.02]))
    views = []
    for offset_m in ((0.0, 0.0), (0.03, -0.02)):
        view = patch_view(ahead, REAR, TEXELS, offset_m)
        views.append(PatchImage(view, light, signal[view.pixels]))
    return PatchExamples([PatchExample(rgb, views, BOX_PX, 0)], RedDetector())


def test_the_search_sees_what_is_painted(examples: PatchExamples) -> None:
    image = examples.examples[0].views[0]
    texture = np.random.default_rng(1).random((48, 3))
    painted = examples.painted(torch.from_numpy(texture).float(), image).numpy()
    assert painted == pytest.approx(image.painted(texture), abs=1e-5)
    middle = image.view.cover > 0.999
    own = image.view.mixed(reflectance(texture)) * image.light.white + image.light.air
    assert painted[middle] == pytest.approx(own[middle], abs=1e-5)


def test_signals_and_levels_are_each_others_inverse() -> None:
    levels = np.arange(256, dtype=np.uint8)
    assert levels_of(signal_of(levels)) == pytest.approx(levels, abs=1)


def test_the_gradient_is_that_of_finite_differences(examples: PatchExamples) -> None:
    """Of the warp, the print, the exposure's curve and the detector together."""
    example = examples.examples[0]
    texture = torch.from_numpy(np.random.default_rng(2).uniform(0.2, 0.8, (48, 3))).float()
    moving = texture.clone().requires_grad_()
    examples.missed(moving, example, example.views[0]).backward()
    assert moving.grad is not None
    for texel, channel in ((0, 0), (17, 1), (47, 2)):
        step = torch.zeros_like(texture)
        step[texel, channel] = 0.05
        apart = [float(examples.missed(texture + sign * step, example, example.views[0])) for sign in (1, -1)]
        slope = (apart[0] - apart[1]) / 0.1
        assert float(moving.grad[texel, channel]) == pytest.approx(slope, rel=0.1, abs=2e-6)


def test_the_search_beats_random_patches(examples: PatchExamples) -> None:
    random = best_random(examples, np.random.default_rng(3), TEXELS, 1)
    best = best_random(examples, np.random.default_rng(3), TEXELS, 20)
    found = optimised(examples, np.random.default_rng(3), TEXELS, 60, 0.1)
    scores = [examples.mean(each) for each in (found, best, random)]
    assert scores[0] < scores[1] - 0.1
    assert scores[1] <= scores[2]
    assert (found >= 0).all()
    assert (found <= 1).all()


def test_the_search_shows_what_is_not(examples: PatchExamples) -> None:
    """The same, for a detector that shall see more than there is."""
    showing = PatchExamples(examples.examples, RedDetector(), hides=False)
    random = best_random(showing, np.random.default_rng(3), TEXELS, 1)
    found = optimised(showing, np.random.default_rng(3), TEXELS, 60, 0.1)
    assert showing.mean(found) < 0.2 * showing.mean(random)
    assert showing.mean(found) == pytest.approx(1 - examples.mean(found), abs=1e-6)


def test_the_same_seed_finds_the_same_texture(examples: PatchExamples) -> None:
    a, b, c = (optimised(examples, np.random.default_rng(seed), TEXELS, 5, 0.1) for seed in (4, 4, 5))
    assert a.tobytes() == b.tobytes() != c.tobytes()
