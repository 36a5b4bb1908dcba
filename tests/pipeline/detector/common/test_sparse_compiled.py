"""Compiled sparse convolution against PyTorch's own operations, of which dense conv3d is the oracle."""

from __future__ import annotations

import pytest
import torch

from advpipe.pipeline.detector.common import sparse_compiled
from advpipe.pipeline.detector.common.backbone3d import STRIDED
from advpipe.pipeline.detector.common.sparse_conv import (
    Rulebook,
    Sites,
    sparse_convolution,
    strided_rules,
    submanifold_rules,
)

pytestmark = pytest.mark.skipif(not sparse_compiled.is_compiled(), reason="needs a C compiler")

SHAPE = (9, 20, 24)
GEOMETRIES = [None, *STRIDED, ((2, 3, 1), (1, 2, 3), (0, 2, 0))]


@pytest.fixture
def in_pytorch(monkeypatch):
    """Call a function without the compiled ones."""

    def call(function, *arguments):
        with monkeypatch.context() as patch:
            patch.setattr(sparse_compiled, "is_compiled", lambda: False)
            return function(*arguments)

    return call


def some_sites(share: float = 0.2) -> Sites:
    torch.manual_seed(0)
    occupied = torch.rand(2, *SHAPE) < share
    # The outermost cells too: padding must not wrap into the next row, layer or cloud.
    occupied[:, 0, 0, :] = occupied[:, -1, -1, -1] = occupied[0, :, -1, 0] = True
    return Sites(Sites.key(*occupied.nonzero().unbind(1), SHAPE), SHAPE, 2)


def rules_of(sites: Sites, geometry) -> Rulebook:
    return submanifold_rules(sites) if geometry is None else strided_rules(sites, *geometry)


def offsets_of(geometry) -> int:
    return 27 if geometry is None else torch.Size(geometry[0]).numel()


def results(sites: Sites, geometry, c_in: int, c_out: int, dtype=torch.float32) -> list[torch.Tensor]:
    """Output and both gradients."""
    torch.manual_seed(1)
    rules = rules_of(sites, geometry)
    features = torch.randn(len(sites), c_in).to(dtype).requires_grad_()
    weight = torch.randn(offsets_of(geometry), c_in, c_out).to(dtype).requires_grad_()
    out = sparse_convolution(features, weight, rules)
    push = torch.linspace(-1, 1, out.numel(), dtype=dtype).view_as(out)
    return [out.detach(), *torch.autograd.grad((out * push).sum(), (features, weight))]


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_rules_equal_those_of_pytorch(geometry, in_pytorch):
    sites, offsets = some_sites(), offsets_of(geometry)
    ours, theirs = rules_of(sites, geometry), in_pytorch(rules_of, sites, geometry)
    assert torch.equal(ours.sites.keys, theirs.sites.keys)
    assert ours.sites.shape == theirs.sites.shape
    assert torch.equal(ours.table(offsets), theirs.table(offsets))
    assert torch.equal(ours.table_of_inputs(offsets, len(sites)), theirs.table_of_inputs(offsets, len(sites)))


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("c_in", "c_out"),
    [(7, 16), (16, 16), (16, 32), (32, 64), (64, 64), (5, 3), (9, 70), (64, 128), (33, 112)],
)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_products_equal_those_of_pytorch_in_double_precision(geometry, c_in, c_out, in_pytorch):
    ours = results(some_sites(), geometry, c_in, c_out)
    theirs = in_pytorch(results, some_sites(), geometry, c_in, c_out, torch.float64)
    for single, double in zip(ours, theirs, strict=True):
        assert single.dtype == torch.float32
        assert single.shape == double.shape
        assert float((single - double).norm() / double.norm()) < 1e-6


def test_rows_of_another_layout_are_read_as_they_are():
    sites = some_sites()
    rules, weight = submanifold_rules(sites), torch.randn(27, 16, 16).transpose(1, 2)
    features = torch.randn(16, len(sites)).T
    out = sparse_convolution(features, weight, rules)
    assert torch.equal(out, sparse_convolution(features.contiguous(), weight.contiguous(), rules))


def test_the_same_input_gives_the_same_bytes():
    first, second = (results(some_sites(), None, 16, 32) for _ in range(2))
    assert all(torch.equal(a, b) for a, b in zip(first, second, strict=True))


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("cells", [0, 1])
def test_none_or_one_occupied_cell(cells, geometry, in_pytorch):
    keys = Sites.key(*(torch.zeros(cells, dtype=torch.int64) for _ in range(4)), SHAPE)
    sites = Sites(keys, SHAPE, 1)
    ours = results(sites, geometry, 4, 16)
    theirs = in_pytorch(results, sites, geometry, 4, 16)
    torch.testing.assert_close(ours, theirs)


def test_the_rules_of_a_large_kernel_are_left_to_pytorch(in_pytorch):
    sites, geometry = some_sites(), ((3, 5, 5), (1, 2, 2), (1, 2, 2))
    ours, theirs = results(sites, geometry, 3, 4), in_pytorch(results, sites, geometry, 3, 4)
    torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("features", "weight"),
    [((-1, 5), (27, 4, 16)), ((-1, 4), (9, 4, 16)), ((-1, 4), (30, 4, 16)), ((50, 4), (27, 4, 16))],
)
def test_values_that_do_not_fit_the_rules_are_refused(features, weight):
    sites = some_sites()
    rows, columns = features
    values = torch.randn(len(sites) if rows < 0 else rows, columns)
    with pytest.raises(ValueError, match="does not fit its rules"):
        sparse_convolution(values, torch.randn(weight), submanifold_rules(sites))


def test_weights_in_another_precision_are_not_read_as_single():
    sites = some_sites()
    with pytest.raises(RuntimeError):
        sparse_convolution(
            torch.randn(len(sites), 4), torch.randn(27, 4, 16).double(), submanifold_rules(sites)
        )


def test_a_second_derivative_is_refused():
    sites = some_sites()
    features = torch.randn(len(sites), 4, requires_grad=True)
    out = sparse_convolution(features, torch.randn(27, 4, 16), submanifold_rules(sites))
    (gradient,) = torch.autograd.grad((out**2).sum(), features, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        gradient.sum().backward()
