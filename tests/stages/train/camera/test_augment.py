"""Sections of pictures: the boxes stay on what they bound."""

from __future__ import annotations

import numpy as np
import pytest
from picture_drive import COLOURS, painted

from advpipe.pipeline.image_detector.targets import PictureObjects
from advpipe.stages.train.camera.augment import section_of
from advpipe.stages.train.camera.config import ImageAugmentation

RECTANGLES = [(0, (30, 40, 99, 89)), (3, (150, 30, 165, 95))]
OBJECTS = PictureObjects(
    np.array([edges for _, edges in RECTANGLES], np.float32), np.array([0, 3]), np.ones(2, bool)
)
SAME_LIGHT = {"light": 0.0, "colour": 0.0, "contrast": 0.0}


@pytest.mark.parametrize("seed", range(12))
def test_boxes_bound_the_same_pixels_afterwards(seed: int) -> None:
    settings = ImageAugmentation(size_px=(160, 96), scale=(0.5, 2.0), **SAME_LIGHT)
    image, found = section_of(painted(RECTANGLES), OBJECTS, settings, np.ones(4), np.random.default_rng(seed))
    assert image.shape == (3, 96, 160)
    for box, label in zip(found.boxes_px, found.labels, strict=True):
        away = np.abs(image * 255 - COLOURS[label][:, None, None]).max(axis=0)
        rows, columns = np.nonzero(away < 60)
        seen = [columns.min(), rows.min(), columns.max(), rows.max()]
        assert np.abs(box - seen).max() <= 1.6


def test_a_section_as_large_as_the_picture_is_the_picture() -> None:
    settings = ImageAugmentation(size_px=(192, 128), scale=(1.0, 1.0), flip=False, **SAME_LIGHT)
    whole = painted(RECTANGLES)
    image, found = section_of(whole, OBJECTS, settings, np.ones(4), np.random.default_rng(0))
    np.testing.assert_allclose(image.transpose(1, 2, 0) * 255, whole, atol=0.01)
    np.testing.assert_allclose(found.boxes_px, OBJECTS.boxes_px, atol=1e-4)


def test_the_same_generator_gives_the_same_section() -> None:
    one, other = (
        section_of(painted(RECTANGLES), OBJECTS, ImageAugmentation(), np.ones(4), np.random.default_rng(9))[0]
        for _ in range(2)
    )
    assert one.tobytes() == other.tobytes()
