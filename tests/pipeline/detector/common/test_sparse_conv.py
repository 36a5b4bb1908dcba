"""Sparse convolution against PyTorch's dense conv3d: output, input and weight gradients."""

from __future__ import annotations

import itertools

import pytest
import torch
from torch.nn import functional as F

from advpipe.pipeline.detector.common.backbone3d import STRIDED, to_bev
from advpipe.pipeline.detector.common.sparse_conv import (
    Sites,
    reached,
    sparse_convolution,
    strided_rules,
    submanifold_rules,
)

SHAPE = (7, 10, 12)


def some_sites(seed: int, share: float = 0.15, shape=SHAPE) -> Sites:
    torch.manual_seed(seed)
    occupied = torch.rand(2, *shape) < share
    # The outermost cells too: padding must not wrap into the next row, layer or cloud.
    occupied[:, 0, 0, :] = occupied[:, -1, -1, -1] = occupied[0, :, -1, 0] = True
    return Sites(Sites.key(*occupied.nonzero().unbind(1), shape), shape, 2)


def dense(features, sites):
    grid = features.new_zeros(sites.batch_size, *sites.shape, features.shape[1])
    return grid.index_put(sites.bzyx(), features).permute(0, 4, 1, 2, 3)


def compare(sites, rules, kernel, stride, padding):
    features = torch.randn(len(sites), 5, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(torch.Size(kernel).numel(), 5, 6, dtype=torch.float64, requires_grad=True)
    out = sparse_convolution(features, weight, rules)
    as_dense = weight.view(*kernel, 5, 6).permute(4, 3, 0, 1, 2)
    expected = F.conv3d(dense(features, sites), as_dense, stride=stride, padding=padding)
    assert expected.shape[2:] == rules.sites.shape
    b, z, y, x = rules.sites.bzyx()
    expected = expected.permute(0, 2, 3, 4, 1)[b, z, y, x]
    torch.testing.assert_close(out, expected)
    push = torch.randn_like(out)
    ours = torch.autograd.grad((out * push).sum(), (features, weight))
    theirs = torch.autograd.grad((expected * push).sum(), (features, weight))
    torch.testing.assert_close(ours, theirs)


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(3))
def test_a_submanifold_layer_equals_a_dense_convolution_at_its_sites(seed):
    sites = some_sites(seed)
    compare(sites, submanifold_rules(sites), (3, 3, 3), 1, 1)


@pytest.mark.oracle
@pytest.mark.parametrize("geometry", STRIDED)
def test_a_strided_layer_equals_a_dense_convolution(geometry):
    sites = some_sites(4)
    kernel, stride, padding = geometry
    rules = strided_rules(sites, kernel, stride, padding)
    compare(sites, rules, kernel, stride, padding)
    # Every cell that a dense convolution of occupancy reaches is a site, and no other.
    everywhere = F.conv3d(
        dense(torch.ones(len(sites), 1), sites), torch.ones(1, 1, *kernel), None, stride, padding
    )
    assert len(rules.sites) == int((everywhere > 0).sum())


def pair_by_pair(sites, kernel, stride, padding, submanifold):
    """The rules as a set of (offset, input row, output row), found cell by cell in a dictionary."""
    cells = [tuple(cell) for cell in torch.stack(sites.bzyx(), 1).tolist()]
    sizes = zip(sites.shape, kernel, stride, padding, strict=True)
    shape = [(n + 2 * p - k) // s + 1 for n, k, s, p in sizes]
    reached = {}
    for row, (b, *cell) in enumerate(cells):
        for number, offset in enumerate(itertools.product(*map(range, kernel))):
            moved = [x + p - i for x, p, i in zip(cell, padding, offset, strict=True)]
            out = [m / s for m, s in zip(moved, stride, strict=True)]
            if all(o.is_integer() and 0 <= o < n for o, n in zip(out, shape, strict=True)):
                reached.setdefault((b, *out), []).append((number, row))
    outputs = cells if submanifold else sorted(reached)
    return {(number, row, place) for place, cell in enumerate(outputs) for number, row in reached[cell]}


@pytest.mark.parametrize("geometry", [None, *STRIDED])
def test_rules_equal_those_found_cell_by_cell(geometry):
    sites = some_sites(6, 0.1, (5, 6, 7))
    kernel, stride, padding = geometry or ((3, 3, 3), (1, 1, 1), (1, 1, 1))
    rules = strided_rules(sites, *geometry) if geometry else submanifold_rules(sites)
    ours = [
        (k, i, o) for k, rows, outs in rules.pairs for i, o in zip(rows.tolist(), outs.tolist(), strict=True)
    ]
    if geometry is None:
        ours += [(rules.centre, row, row) for row in range(len(sites))]
    assert len(ours) == len(set(ours))
    assert set(ours) == pair_by_pair(sites, kernel, stride, padding, geometry is None)


def test_keys_identify_their_cells():
    sites = some_sites(1)
    assert torch.equal(Sites.key(*sites.bzyx(), SHAPE), sites.keys)
    assert (sites.keys.diff() > 0).all()


def test_reached_occupancy_and_its_gradient_are_exact():
    # Three cells in a row, stride 2: outputs 0 and 1 see cells {0, 1} and {1, 2}.
    shape = (1, 1, 3)
    cells = torch.tensor([0, 1, 2])
    zero = torch.zeros(3, dtype=torch.int64)
    sites = Sites(Sites.key(zero, zero, zero, cells, shape), shape, 1)
    rules = strided_rules(sites, (1, 1, 3), (1, 1, 2), (0, 0, 1))
    for occupancy, expected, jacobian in [
        ([1.0, 1.0, 1.0], [1.0, 1.0], [[0, 0, 0], [0, 0, 0]]),
        ([0.0, 1.0, 0.0], [1.0, 1.0], [[0, 1, 0], [0, 1, 0]]),
        ([1.0, 0.0, 0.0], [1.0, 0.0], [[1, 0, 0], [0, 1, 1]]),
    ]:
        leaf = torch.tensor(occupancy, requires_grad=True)
        out = reached(leaf, rules)
        assert out.tolist() == expected
        rows = [torch.autograd.grad(value, leaf, retain_graph=True)[0].tolist() for value in out]
        assert rows == jacobian


def test_birds_eye_map_stacks_the_layers_of_a_column():
    sites = some_sites(2, shape=(3, 4, 5))
    rules = strided_rules(sites, (1, 1, 1), (1, 1, 1), (0, 0, 0))
    features = torch.randn(len(sites), 2)
    expected = dense(features, sites).permute(0, 2, 1, 3, 4).reshape(2, 6, 4, 5)
    bev = to_bev(features, rules)
    assert torch.equal(bev, expected)
    assert bev.is_contiguous(memory_format=torch.channels_last)


def test_layers_accept_no_sites():
    empty = Sites(torch.zeros(0, dtype=torch.int64), SHAPE, 1)
    down = strided_rules(empty, *STRIDED[0])
    weight = torch.randn(27, 3, 4)
    assert sparse_convolution(torch.zeros(0, 3), weight, submanifold_rules(empty)).shape == (0, 4)
    assert sparse_convolution(torch.zeros(0, 3), weight, down).shape == (0, 4)
