"""The network in pictures of any size, and the gradient of what it says of objects."""

from __future__ import annotations

import copy

import numpy as np
import pytest
import torch

from advpipe.pipeline.image_detector.boxes import pairwise_iou
from advpipe.pipeline.image_detector.network import PRESETS, STRIDE, ImageNet, with_folded_norms
from advpipe.pipeline.image_detector.network_detector import NetworkImageDetector
from advpipe.pipeline.image_detector.protocol import (
    OVERLAP,
    DifferentiableImageDetector,
    ImageDetections,
    ImageDetector,
)


@pytest.fixture(scope="module")
def net() -> ImageNet:
    """Random weights, with batch norms that are not the identity and scores that differ."""
    torch.manual_seed(3)
    net = ImageNet(PRESETS["small"])
    for module in net.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean = torch.randn_like(module.running_mean) * 0.1
            module.running_var = torch.rand_like(module.running_var) + 0.5
    for branch in (net.score, net.edges):
        torch.nn.init.normal_(branch[-1].weight, std=0.5)
    torch.nn.init.zeros_(net.score[-1].bias)
    torch.nn.init.constant_(net.edges[-1].bias, 1.0)  # boxes of some 42 pixels
    return net.eval()


@pytest.fixture(scope="module")
def detector(net: ImageNet) -> NetworkImageDetector:
    return NetworkImageDetector(net)


def picture(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (height, width, 3)).astype(np.uint8)


def test_it_is_an_image_detector(detector: NetworkImageDetector) -> None:
    assert isinstance(detector, ImageDetector)
    assert isinstance(detector, DifferentiableImageDetector)


@pytest.mark.parametrize(("height", "width"), [(64, 96), (61, 97), (1, 1), (33, 200)])
def test_pictures_of_any_size_have_detections_inside(
    detector: NetworkImageDetector, height: int, width: int
) -> None:
    found = detector.detect(picture(height, width))
    assert isinstance(found, ImageDetections)
    assert len(found) > 0
    assert (found.boxes_px >= 0).all()
    assert (found.boxes_px <= [width - 1, height - 1] * 2).all()
    assert (np.diff(found.scores) <= 0).all()
    assert (found.scores >= 0.05).all()


def test_there_is_a_cell_for_every_four_pixels(net: ImageNet) -> None:
    with torch.no_grad():
        cells = net(torch.rand(2, 3, 61, 97))
    assert cells.logits.shape == (2, 4, -(-61 // STRIDE), -(-97 // STRIDE))
    assert cells.boxes_px.shape == (2, 4, 16, 25)


def test_without_batch_norms_it_says_the_same(net: ImageNet) -> None:
    image = torch.rand(1, 3, 64, 64)
    with torch.no_grad():
        ours, folded = net(image), with_folded_norms(net)(image)
    torch.testing.assert_close(ours.logits, folded.logits, atol=1e-3, rtol=1e-3)
    torch.testing.assert_close(ours.boxes_px, folded.boxes_px, atol=1e-2, rtol=1e-3)


def test_the_same_picture_has_the_same_detections(detector: NetworkImageDetector) -> None:
    image = picture(64, 64)
    one, other = detector.detect(image), detector.detect(image[:, ::-1][:, ::-1])
    assert one.boxes_px.tobytes() == other.boxes_px.tobytes()
    assert one.scores.tobytes() == other.scores.tobytes()


def test_objectness_is_the_highest_score_among_boxes_that_overlap(net: ImageNet) -> None:
    detector, image = NetworkImageDetector(net), torch.rand(3, 64, 96)
    boxes, labels = torch.tensor([[10.0, 10, 40, 50], [90.0, 60, 90.5, 60.5]]), torch.tensor([0, 3])
    found = detector.objectness(image, boxes, labels)
    with torch.no_grad():
        cells = net(image[None])
    overlaps = pairwise_iou(boxes, cells.boxes_px[0].flatten(1).T)
    scores = torch.sigmoid(cells.logits[0].flatten(1))
    assert float(found[0]) == pytest.approx(float(scores[0][overlaps[0] >= OVERLAP].max()), abs=1e-4)
    assert overlaps[1].max() < OVERLAP  # nobody proposes it: the nearest place counts
    assert float(found[1]) == pytest.approx(
        float(scores[3][overlaps[1] == overlaps[1].max()].max()), abs=1e-4
    )


def test_no_objects_have_no_objectness(detector: NetworkImageDetector) -> None:
    found = detector.objectness(torch.rand(3, 32, 32), torch.zeros(0, 4), torch.zeros(0, dtype=torch.int64))
    assert found.shape == (0,)


def test_the_gradient_of_objectness_agrees_with_finite_differences(net: ImageNet) -> None:
    """Along the gradient in a random half of all pixels, in double precision."""
    detector = NetworkImageDetector(copy.deepcopy(net).double())
    generator = torch.Generator().manual_seed(0)
    image = torch.rand(3, 64, 96, generator=generator, dtype=torch.float64).requires_grad_()
    boxes, labels = torch.tensor([[10.0, 10, 40, 50], [50.0, 20, 90, 60]]), torch.tensor([0, 1])
    detector.objectness(image, boxes, labels).sum().backward()
    assert image.grad is not None
    for _ in range(4):
        way = image.grad * (torch.rand(image.shape, generator=generator) < 0.5)
        way = way / way.norm() * 1e-6
        with torch.no_grad():
            ends = [detector.objectness(image + sign * way, boxes, labels).sum() for sign in (1, -1)]
        wanted = float((image.grad * way).sum())
        assert wanted > 1e-8
        assert float(ends[0] - ends[1]) / 2 == pytest.approx(wanted, rel=1e-4)
