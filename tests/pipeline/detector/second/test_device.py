"""SECOND off the CPU: on an emulated second device everywhere, and on CUDA where available."""

from __future__ import annotations

import copy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

sys.path.insert(0, str(Path(__file__).parent))

from conftest import TINY
from far_device import FAR, FarDevice, FarTensor

from advpipe.pipeline.detector.common import decode, sparse_compiled, tiles
from advpipe.pipeline.detector.second.model import Second
from advpipe.pipeline.messages.cloud import POINT_DTYPE

needs_cuda = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA GPU")


@pytest.fixture(autouse=True)
def by_pytorch(monkeypatch):
    """As on the emulated device: where an activation is zero but for rounding, gradients differ otherwise."""
    monkeypatch.setattr(sparse_compiled, "is_compiled", lambda: False)


@pytest.fixture(autouse=True)
def one_thread_of_autograd():
    with torch.autograd.set_multithreading_enabled(False):
        yield


def moved(detector: Second) -> Second:
    """Its copy on the far device."""
    net = copy.deepcopy(detector.net)
    for module in net.modules():
        for tensors in (module._parameters, module._buffers):
            tensors |= {name: FarTensor(t.detach()) for name, t in tensors.items() if t is not None}
    return Second(net)


def cloud_of(points):
    cloud = np.zeros(len(points), POINT_DTYPE)
    for column, name in enumerate(("x", "y", "z", "intensity")):
        cloud[name] = points[:, column].numpy()
    return cloud


def all_of_it(detector: Second, points, boxes, labels) -> list[torch.Tensor]:
    """The loss and its gradients, by points and by occupancy, and the detections."""
    leaf, probes = points.clone().requires_grad_(), points[:40] + points.new_tensor([0.0, 0.0, 0.5, 0.0])
    loss = detector.loss(leaf, boxes, labels)
    (to_points,) = torch.autograd.grad(loss, leaf)
    computed = detector.occupancy_loss(leaf, boxes, labels, probes)
    of_occupancy, occupancy, row = computed.loss, computed.occupancy, computed.rows
    gradients = torch.autograd.grad(of_occupancy, [occupancy, leaf])
    found = detector.detect(cloud_of(points))
    assert len(found)
    return [
        loss.detach(),
        to_points,
        of_occupancy.detach(),
        occupancy.detach(),
        row,
        *gradients,
        *map(torch.from_numpy, (found.boxes, found.scores, found.labels)),
    ]


@pytest.mark.parametrize("limits", [{}, {"points_per_voxel": 2, "max_voxels": 200}])
def test_another_device_gives_the_same_results_without_tensors_on_the_cpu(tiny, scene, limits, monkeypatch):
    monkeypatch.setattr(decode, "SCORE_THRESHOLD", 0.01)  # of random weights
    tiny.net.preset = replace(TINY, **limits)
    expected = all_of_it(tiny, *scene)
    with FarDevice() as mode:
        detector = moved(tiny)
        assert detector.device == FAR
        results = all_of_it(detector, *scene)
    assert mode.homeless == []
    for result, wanted in zip(results, expected, strict=True):
        assert type(result) is torch.Tensor
        torch.testing.assert_close(result, wanted, rtol=1e-3, atol=1e-4)


def test_tiles_are_computed_on_another_device(tiny, scene, monkeypatch):
    monkeypatch.setattr(decode, "SCORE_THRESHOLD", 0.01)
    monkeypatch.setattr(tiles, "MARGIN_CELLS", 0)
    near = (scene[0][:, :2] - scene[1][0, :2]).norm(dim=1) < 2
    given = scene[0][near], scene[1][:1], scene[2][:1]
    expected = all_of_it(tiny, *given)
    with FarDevice() as mode:
        detector = moved(tiny)
        results = all_of_it(detector, *given)
        assert detector.net._occupied_map._empty is not None
    assert mode.homeless == []
    for result, wanted in zip(results, expected, strict=True):
        torch.testing.assert_close(result, wanted, rtol=1e-3, atol=1e-4)


def test_the_emulated_device_refuses_what_cuda_refuses():
    with FarDevice() as mode:
        far = torch.ones(3, device=FAR)
        with pytest.raises(RuntimeError, match="same device"):
            far + torch.ones(3)
        with pytest.raises(TypeError, match="numpy"):
            far.numpy()
        assert (2 * far).cpu().tolist() == [2, 2, 2]
    assert mode.homeless == ["ones"]


@needs_cuda
def test_cuda_gives_the_same_results_up_to_rounding(tiny, scene):
    expected = all_of_it(tiny, *scene)
    results = all_of_it(Second(copy.deepcopy(tiny.net).cuda()), *scene)
    for result, wanted in zip(results, expected, strict=True):
        assert result.device.type == "cpu"
        torch.testing.assert_close(result, wanted, rtol=1e-3, atol=1e-4)
