"""Sparse 3D convolution: sites, rulebooks, and the layer itself, in plain PyTorch or in compiled kernels.

Submanifold and strided convolutions of Graham et al., "3D Semantic Segmentation with Submanifold
Sparse Convolutional Networks" (CVPR 2018), as SECOND uses them (Yan et al., Sensors 2018). A rulebook
lists, for each kernel offset, which input row adds to which output row; the layers of one stage share it.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib.util import find_spec
from math import prod
from types import ModuleType
from typing import Any

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from advpipe.pipeline.detector.common import sparse_compiled
from advpipe.pipeline.detector.common.sparse_compiled import Shape as Shape

Pair = tuple[int, Tensor, Tensor]


@dataclass(frozen=True)
class Sites:
    """Occupied cells of a batch of grids.

    keys: (V,) int64, ascending; the linear index in a grid padded by one cell on every side, so that
    no neighbour of a cell is ever a cell of the next row, layer or batch entry.
    shape: cells along z, y, x. batch_size: number of grids.
    """

    keys: Tensor
    shape: Shape
    batch_size: int

    def __len__(self) -> int:
        return len(self.keys)

    @staticmethod
    def key(batch: Tensor, z: Tensor, y: Tensor, x: Tensor, shape: Shape) -> Tensor:
        """The key of each cell."""
        depth, height, width = (n + 2 for n in shape)
        return ((batch * depth + z + 1) * height + y + 1) * width + x + 1

    def bzyx(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Batch entry, z, y and x of each site, (V,) each."""
        depth, height, width = (n + 2 for n in self.shape)
        row = self.keys // width
        layer = row // height
        return layer // depth, layer % depth - 1, row % height - 1, self.keys % width - 1


@dataclass(frozen=True)
class Rulebook:
    """Which input row adds to which output row, through which kernel offset.

    sites: the output's. centre: the offset under which every row adds to itself, -1 if there is none.
    found: `pairs`, where they were found; otherwise both tables were.
    """

    sites: Sites
    centre: int
    found: tuple[Pair, ...] | None = None

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """(offset, input rows, output rows) for each kernel offset that is used, but the centre."""
        if self.found is not None:
            return self.found
        table = self._tables["output"]
        rows = [(k, (table[k] >= 0).nonzero().squeeze(1)) for k in range(len(table)) if k != self.centre]
        return tuple((k, table[k].index_select(0, out).long(), out) for k, out in rows)

    def require_inputs(self, rows: int) -> None:
        """Raises ValueError for another number of input rows than that of the rules, where it is known."""
        known = self._tables.get("input")
        if known is not None and known.shape[1] != rows:
            raise ValueError(f"a sparse convolution of {rows} rows does not fit its rules")

    def rows(self) -> tuple[Tensor, Tensor]:
        """The input rows and the output rows (R,) of `pairs`, all offsets in turn."""
        if self.found is None and self.centre < 0:
            table = self._tables["output"].flatten()
            used = (table >= 0).nonzero().squeeze(1)
            return table.index_select(0, used).long(), used % len(self.sites)
        return torch.cat([i for _, i, _ in self.pairs]), torch.cat([o for _, _, o in self.pairs])

    def table(self, offsets: int) -> Tensor:
        """The input row (offsets, V_out) int32 that adds to each output row through each offset, -1 for
        none."""
        if "output" not in self._tables:
            pairs = [(k, o, i) for k, i, o in self.pairs]
            self._tables["output"] = self._tabulated(offsets, len(self.sites), pairs)
        return self._tables["output"]

    def table_of_inputs(self, offsets: int, inputs: int) -> Tensor:
        """The output row (offsets, inputs) int32 to which each input row adds through each offset, -1 for
        none."""
        if "input" not in self._tables:
            self._tables["input"] = self._tabulated(offsets, inputs, self.pairs)
        return self._tables["input"]

    def _tabulated(self, offsets: int, rows: int, pairs: Iterable[Pair]) -> Tensor:
        keys = self.sites.keys
        table = torch.full((offsets, rows), -1, dtype=torch.int32, device=keys.device)
        if self.centre >= 0:
            table[self.centre] = torch.arange(rows, dtype=torch.int32, device=keys.device)
        for k, at, other in pairs:
            table[k].index_copy_(0, at, other.int())
        return table

    _tables: dict[str, Tensor] = field(default_factory=dict, compare=False, repr=False)

    @classmethod
    def of_tables(cls, sites: Sites, centre: int, table: Tensor, table_of_inputs: Tensor) -> Rulebook:
        """The rules of both tables, see `table` and `table_of_inputs`."""
        return cls(sites, centre, None, {"output": table, "input": table_of_inputs})


def submanifold_rules(sites: Sites) -> Rulebook:
    """Rules of a 3 x 3 x 3 convolution whose output sites are its input sites."""
    _, height, width = (n + 2 for n in sites.shape)
    keys = sites.keys
    if _is_compiled_for(keys):
        table = sparse_compiled.submanifold_table(keys, sites.shape)
        return Rulebook.of_tables(sites, 13, table, table.flip(0))
    guarded = torch.cat([keys, keys.new_full((2,), -1)])
    rows = torch.arange(len(keys), device=keys.device)
    pairs = []
    # Half of the offsets, row by row; the other half is the mirror image. One binary search finds the
    # start of a row of three neighbours; the sites are sorted, so the next can only be the next entry.
    for dz, dy in ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1)):
        first_dx = 1 if (dz, dy) == (0, 0) else -1
        wanted = keys + ((dz * height + dy) * width + first_dx)
        at = rows + 1 if first_dx == 1 else torch.searchsorted(keys, wanted)
        for dx in range(first_dx, 2):
            found = guarded.index_select(0, at) == wanted
            here = found.nonzero().squeeze(1)
            there = at.index_select(0, here)
            offset = (dz * 3 + dy) * 3 + dx
            pairs += [(13 + offset, there, here), (13 - offset, here, there)]
            at, wanted = at + found, wanted + 1
    return Rulebook(sites, 13, tuple(pairs))


def strided_rules(sites: Sites, kernel: Shape, stride: Shape, padding: Shape) -> Rulebook:
    """Rules of a convolution whose output sites are all cells that an input site reaches."""
    sizes = zip(sites.shape, kernel, stride, padding, strict=True)
    shape: Shape = tuple((n + 2 * p - k) // s + 1 for n, k, s, p in sizes)  # type: ignore[assignment]
    if prod(kernel) <= sparse_compiled.MOST_OFFSETS and _is_compiled_for(sites.keys):
        keys, table, table_of_inputs = sparse_compiled.strided_tables(
            sites.keys, sites.shape, shape, sites.batch_size, kernel, stride, padding
        )
        return Rulebook.of_tables(Sites(keys, shape, sites.batch_size), -1, table, table_of_inputs)
    batch, *position = sites.bzyx()
    # Per axis and kernel index: which sites reach an output cell, and its share of the cell's key.
    steps = ((shape[1] + 2) * (shape[2] + 2), shape[2] + 2, 1)
    axes: list[list[tuple[Tensor, Tensor]]] = []
    for x, n, k, s, p, step in zip(position, shape, kernel, stride, padding, steps, strict=True):
        moved = [x + p - i for i in range(k)]
        out = [torch.div(m, s, rounding_mode="floor") for m in moved]
        axes.append(
            [((o * s == m) & (o >= 0) & (o < n), (o + 1) * step) for m, o in zip(moved, out, strict=True)]
        )
    first = batch * ((shape[0] + 2) * steps[0])
    found = []
    for iz, (z_ok, z) in enumerate(axes[0]):
        for iy, (y_ok, y) in enumerate(axes[1]):
            zy_rows = (z_ok & y_ok).nonzero().squeeze(1)
            zy = (first + z + y).index_select(0, zy_rows)
            for ix, (x_ok, x) in enumerate(axes[2]):
                among = x_ok.index_select(0, zy_rows).nonzero().squeeze(1)
                rows = zy_rows.index_select(0, among)
                keys = zy.index_select(0, among) + x.index_select(0, rows)
                found.append(((iz * kernel[1] + iy) * kernel[2] + ix, rows, keys))
    keys, inverse = torch.unique(torch.cat([k for _, _, k in found]), return_inverse=True)
    outputs = torch.split(inverse, [len(rows) for _, rows, _ in found])
    pairs = tuple((k, rows, out) for (k, rows, _), out in zip(found, outputs, strict=True))
    return Rulebook(Sites(keys, shape, sites.batch_size), -1, pairs)


class _SparseConvolution(torch.autograd.Function):
    """out[o] = sum of features[i] @ weight[k] over the rulebook; weight (K, C_in, C_out)."""

    @staticmethod
    def forward(ctx: Any, features: Tensor, weight: Tensor, rules: Rulebook) -> Tensor:
        ctx.save_for_backward(features, weight)
        ctx.rules = rules
        rules.require_inputs(len(features))
        if (kernels := _kernels(features, weight)) is not None:
            made: Tensor = kernels.gathered_products(features, weight, rules.table(len(weight)))
            return made
        if rules.centre >= 0:
            out = features @ weight[rules.centre]
        else:
            out = features.new_zeros(len(rules.sites), weight.shape[2])
        for k, i, o in rules.pairs:
            out.index_add_(0, o, features.index_select(0, i) @ weight[k])
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        (grad,) = grads
        features, weight = ctx.saved_tensors
        rules: Rulebook = ctx.rules
        grad = grad.contiguous()
        to_features, to_weight = ctx.needs_input_grad[:2]
        grad_features = grad_weight = None
        if (kernels := _kernels(features, weight)) is not None:
            offsets, inputs = len(weight), len(features)
            if to_features:
                table = rules.table_of_inputs(offsets, inputs)
                grad_features = kernels.gathered_products(grad, weight.transpose(1, 2), table)
            if to_weight:
                grad_weight = kernels.weight_products(features, grad, rules.table(offsets))
            return grad_features, grad_weight, None
        if to_features:
            centre = rules.centre
            grad_features = grad @ weight[centre].T if centre >= 0 else torch.zeros_like(features)
        if to_weight:
            grad_weight = torch.zeros_like(weight)
            if rules.centre >= 0:
                torch.mm(features.T, grad, out=grad_weight[rules.centre])
        for k, i, o in rules.pairs:
            picked = grad.index_select(0, o)
            if grad_features is not None:
                grad_features.index_add_(0, i, picked @ weight[k].T)
            if grad_weight is not None:
                torch.mm(features.index_select(0, i).T, picked, out=grad_weight[k])
        return grad_features, grad_weight, None


def _kernels(features: Tensor, weight: Tensor) -> ModuleType | None:
    """The kernels that compute such features; None where PyTorch's own operations do."""
    if features.dtype != torch.float32 or weight.dtype != torch.float32:
        return None
    if _is_compiled_for(features):
        return sparse_compiled
    if features.is_cuda and _has_triton(features.device):
        from advpipe.pipeline.detector.common import sparse_kernels

        return sparse_kernels
    return None


def _is_compiled_for(tensor: Tensor) -> bool:
    return tensor.device.type == "cpu" and sparse_compiled.is_compiled()


@cache
def _has_triton(device: torch.device) -> bool:
    """Whether Triton is there, the C compiler that it calls, and a GPU that it knows."""
    compilers = (os.environ.get("CC"), "gcc", "clang")
    has_compiler = any(shutil.which(each) for each in compilers if each)
    return (
        has_compiler and find_spec("triton") is not None and torch.cuda.get_device_capability(device) >= (7,)
    )


def sparse_convolution(features: Tensor, weight: Tensor, rules: Rulebook) -> Tensor:
    """Features (V_out, C_out) from features (V_in, C_in) and weight (K, C_in, C_out)."""
    out: Tensor = _SparseConvolution.apply(features, weight, rules)  # type: ignore[no-untyped-call]
    return out


def reached(occupancy: Tensor, rules: Rulebook) -> Tensor:
    """Occupancy (V_out,) of a strided layer's outputs: 1 - product of (1 - occupancy) over its inputs.

    An output exists while one of its inputs does. Differentiable, also where a factor is zero.
    """
    inputs, outputs = rules.rows()
    empty = occupancy.new_ones(len(rules.sites)).scatter_reduce(0, outputs, 1 - occupancy[inputs], "prod")
    return 1 - empty


class SparseLayer(nn.Module):
    """Sparse convolution without bias, batch norm, ReLU, and the occupancy mask if there is one."""

    def __init__(self, c_in: int, c_out: int, kernel: Shape = (3, 3, 3)) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(prod(kernel), c_in, c_out))
        # About a third of the kernel meets an occupied cell.
        nn.init.normal_(self.weight, std=(2 / (c_in * max(1.0, prod(kernel) / 3))) ** 0.5)
        self.norm = nn.BatchNorm1d(c_out, eps=1e-3, momentum=0.05)

    def forward(self, features: Tensor, rules: Rulebook, occupancy: Tensor | None = None) -> Tensor:
        out = torch.relu_(self.norm(sparse_convolution(features, self.weight, rules)))
        return out if occupancy is None else out * occupancy[:, None]
