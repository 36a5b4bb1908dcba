"""Sparse convolution in Triton's kernels against PyTorch's own operations, on a GPU."""

import pytest
import torch

from advpipe.pipeline.detector.common.backbone3d import STRIDED
from advpipe.pipeline.detector.common.sparse_conv import (
    Sites,
    sparse_convolution,
    strided_rules,
    submanifold_rules,
)

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA GPU")


def some_sites(device: str) -> Sites:
    torch.manual_seed(0)
    occupied = torch.rand(2, 9, 20, 24) < 0.2
    keys = Sites.key(*occupied.nonzero().unbind(1), (9, 20, 24))
    return Sites(keys.to(device), (9, 20, 24), 2)


def results(device: str, c_in: int, c_out: int, geometry) -> list[torch.Tensor]:
    """Output and both gradients, on the CPU."""
    sites = some_sites(device)
    rules = submanifold_rules(sites) if geometry is None else strided_rules(sites, *geometry)
    kernel = (3, 3, 3) if geometry is None else geometry[0]
    torch.manual_seed(1)
    features = torch.randn(len(sites), c_in).to(device).requires_grad_()
    weight = torch.randn(torch.Size(kernel).numel(), c_in, c_out).to(device).requires_grad_()
    out = sparse_convolution(features, weight, rules)
    push = torch.linspace(-1, 1, out.numel(), device=device).view_as(out)
    gradients = torch.autograd.grad((out * push).sum(), (features, weight))
    return [each.detach().cpu() for each in (out, *gradients)]


@pytest.mark.parametrize(("c_in", "c_out"), [(7, 16), (64, 64), (128, 70)])
@pytest.mark.parametrize("geometry", [None, *STRIDED])
def test_the_kernels_equal_the_operations_of_a_cpu(c_in, c_out, geometry):
    ours, theirs = (results(device, c_in, c_out, geometry) for device in ("cuda", "cpu"))
    torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-4)


def test_the_same_input_gives_the_same_bytes():
    first, second = (results("cuda", 16, 32, None) for _ in range(2))
    assert all(torch.equal(a, b) for a, b in zip(first, second, strict=True))
