"""Sparse convolution on a GPU in three kernels, in Triton, which PyTorch's CUDA builds bring along.

Each output row gathers its inputs through a table, kernel offset by offset, and multiplies them by the
offset's weights without writing them down ("implicit GEMM"; Tang et al., "TorchSparse++", MICRO 2023). Sums
have a fixed order, so that the same input gives the same bytes.
"""

from __future__ import annotations

import torch
import triton
import triton.language as tl
from torch import Tensor

ROWS, PARTS = 64, 32
"""Rows that one program computes at a time; parts of the rows that sum up a weight's gradient apart."""


@triton.jit  # type: ignore[untyped-decorator]
def _gathered_products(  # type: ignore[no-untyped-def]
    features, weight, table, out, rows,
    offsets: tl.constexpr, c_in: tl.constexpr, c_out: tl.constexpr,
    ROWS: tl.constexpr, C_IN: tl.constexpr, C_OUT: tl.constexpr, PRECISION: tl.constexpr,
):  # fmt: skip
    """out[o] = sum over k of features[table[k, o]] @ weight[k]; a table's -1 stands for no row."""
    row = tl.program_id(0) * ROWS + tl.arange(0, ROWS)
    column = tl.program_id(1) * C_OUT + tl.arange(0, C_OUT)
    total = tl.zeros((ROWS, C_OUT), dtype=tl.float32)
    for k in range(offsets):
        source = tl.load(table + k * rows + row, mask=row < rows, other=-1)
        if tl.max(source, axis=0) >= 0:
            for first in range(0, c_in, C_IN):
                channel = first + tl.arange(0, C_IN)
                read = (source >= 0)[:, None] & (channel < c_in)[None, :]
                place = source.to(tl.int64)[:, None] * c_in + channel[None, :]
                values = tl.load(features + place, mask=read, other=0.0)
                factor = tl.load(
                    weight + (k * c_in + channel[:, None]) * c_out + column[None, :],
                    mask=(channel < c_in)[:, None] & (column < c_out)[None, :],
                    other=0.0,
                )
                total = tl.dot(values, factor, total, input_precision=PRECISION)
    tl.store(
        out + row.to(tl.int64)[:, None] * c_out + column[None, :],
        total,
        mask=(row < rows)[:, None] & (column < c_out)[None, :],
    )


@triton.jit  # type: ignore[untyped-decorator]
def _weight_products(  # type: ignore[no-untyped-def]
    features, grad, table, out, rows, rows_of_part,
    offsets: tl.constexpr, c_in: tl.constexpr, c_out: tl.constexpr,
    ROWS: tl.constexpr, C_IN: tl.constexpr, C_OUT: tl.constexpr, PRECISION: tl.constexpr,
):  # fmt: skip
    """out[part, k] = sum over the part's rows o of features[table[k, o]].T @ grad[o]."""
    k, part = tl.program_id(0), tl.program_id(1)
    blocks_out = tl.cdiv(c_out, C_OUT)
    channel = tl.program_id(2) // blocks_out * C_IN + tl.arange(0, C_IN)
    column = tl.program_id(2) % blocks_out * C_OUT + tl.arange(0, C_OUT)
    total = tl.zeros((C_IN, C_OUT), dtype=tl.float32)
    begin = part * rows_of_part
    for first in range(begin, tl.minimum(begin + rows_of_part, rows), ROWS):
        row = first + tl.arange(0, ROWS)
        source = tl.load(table + k * rows + row, mask=row < rows, other=-1)
        if tl.max(source, axis=0) >= 0:
            # Transposed as they are read: a channel a row.
            values = tl.load(
                features + source.to(tl.int64)[None, :] * c_in + channel[:, None],
                mask=(source >= 0)[None, :] & (channel < c_in)[:, None],
                other=0.0,
            )
            gradient = tl.load(
                grad + row.to(tl.int64)[:, None] * c_out + column[None, :],
                mask=(source >= 0)[:, None] & (column < c_out)[None, :],
                other=0.0,
            )
            total = tl.dot(values, gradient, total, input_precision=PRECISION)
    tl.store(
        out + ((part * offsets + k) * c_in + channel[:, None]) * c_out + column[None, :],
        total,
        mask=(channel < c_in)[:, None] & (column < c_out)[None, :],
    )


def gathered_products(features: Tensor, weight: Tensor, table: Tensor) -> Tensor:
    """Rows (V_out, C_out): for each, the sum over k of features (V_in, C_in) at table[k] times weight[k].

    weight: (K, C_in, C_out). table: (K, V_out) int32 rows of `features`, -1 for none. All float32.
    """
    offsets, c_in, c_out = weight.shape
    rows = table.shape[1]
    out = features.new_empty(rows, c_out)
    width = _block(c_out, 64)
    grid = triton.cdiv(rows, ROWS), triton.cdiv(c_out, width)
    if rows:
        _gathered_products[grid](
            features.contiguous(), weight.contiguous(), table, out, rows, offsets, c_in, c_out,
            ROWS, _block(c_in, 32), width, _precision(),
        )  # fmt: skip
    return out


def weight_products(features: Tensor, grad: Tensor, table: Tensor) -> Tensor:
    """The gradient (K, C_in, C_out) of the weights of `gathered_products` from that (V_out, C_out) of its
    rows."""
    offsets, rows = table.shape
    c_in, c_out = features.shape[1], grad.shape[1]
    rows_of_part = triton.cdiv(triton.cdiv(max(rows, 1), PARTS), ROWS) * ROWS
    parts = triton.cdiv(max(rows, 1), rows_of_part)
    out = features.new_empty(parts, offsets, c_in, c_out)
    height, width = _block(c_in, 64), _block(c_out, 64)
    grid = offsets, parts, triton.cdiv(c_in, height) * triton.cdiv(c_out, width)
    _weight_products[grid](
        features.contiguous(), grad.contiguous(), table, out, rows, rows_of_part, offsets, c_in, c_out,
        ROWS, height, width, _precision(),
    )  # fmt: skip
    return out.sum(0)


def _block(channels: int, most: int) -> int:
    """Channels at a time: a power of two that a matrix unit takes."""
    return max(16, min(most, 1 << (channels - 1).bit_length()))


def _precision() -> str:
    """As PyTorch's own matrix products on a GPU."""
    return "tf32" if torch.backends.cuda.matmul.allow_tf32 else "ieee"
