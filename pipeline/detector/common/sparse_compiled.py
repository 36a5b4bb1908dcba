"""Sparse convolution on a CPU, compiled from `sparse.c` where the machine has a C compiler."""

from __future__ import annotations

import ctypes
from functools import cache
from math import prod
from pathlib import Path

import torch
from torch import Tensor
from torch.nn import functional as F

from advpipe.pipeline.core.compiled import compiled_library, compiler_version

Shape = tuple[int, int, int]

LANES = 16
"""Output channels come in multiples of so many."""

MOST_OFFSETS = 27
"""Of a kernel whose rules `sparse.c` finds."""

SOURCE = Path(__file__).with_name("sparse.c")


class Geometry(ctypes.Structure):
    """`geometry` of `sparse.c`."""

    _fields_ = tuple(
        (name, ctypes.c_int64 * 3) for name in ("inputs", "outputs", "kernel", "stride", "padding")
    )


@cache
def is_compiled() -> bool:
    """Whether this machine has the functions; the first call may take a second to compile them."""
    return compiled_library(SOURCE) is not None


def origin() -> str:
    """Where the functions of a CPU come from, for people."""
    return f"compiled by {compiler_version()}" if is_compiled() else "by PyTorch"


def gathered_products(features: Tensor, weight: Tensor, table: Tensor) -> Tensor:
    """Rows (V_out, C_out): for each, the sum over k of features (V_in, C_in) at table[k] times weight[k].

    weight: (K, C_in, C_out). table: (K, V_out) int32 rows of `features`, -1 for none. All float32.
    """
    offsets, c_in, c_out = weight.shape
    rows, columns = table.shape[1], _padded(c_out)
    _require(features.shape[1] == c_in and len(table) == offsets, features, weight)
    weight = F.pad(weight, (0, columns - c_out)).contiguous()
    out = torch.empty(rows, columns, dtype=torch.float32, device="cpu")
    scratch = torch.empty(c_in + columns, dtype=torch.float32, device="cpu")
    _call(
        "gathered_products", features.contiguous(), weight, table, out, rows, offsets, c_in, columns, scratch
    )
    return out if columns == c_out else out[:, :c_out].contiguous()


def weight_products(features: Tensor, grad: Tensor, table: Tensor) -> Tensor:
    """The gradient (K, C_in, C_out) of the weights of `gathered_products` from that (V_out, C_out) of its
    rows."""
    (offsets, rows), c_in, c_out = table.shape, features.shape[1], grad.shape[1]
    columns = _padded(c_out)
    _require(len(grad) == rows, features, grad)
    grad = F.pad(grad, (0, columns - c_out)).contiguous()
    out = torch.empty(offsets, c_in, columns, dtype=torch.float32, device="cpu")
    _call("weight_products", features.contiguous(), grad, table, out, rows, offsets, c_in, columns)
    return out if columns == c_out else out[:, :, :c_out].contiguous()


def submanifold_table(keys: Tensor, shape: Shape) -> Tensor:
    """The table (27, V) of a 3 x 3 x 3 convolution whose output sites are its input sites."""
    table = torch.empty(27, len(keys), dtype=torch.int32, device="cpu")
    _call("submanifold_table", keys.contiguous(), len(keys), shape[1] + 2, shape[2] + 2, table)
    return table


def strided_tables(
    keys: Tensor, inputs: Shape, outputs: Shape, batch_size: int, kernel: Shape, stride: Shape, padding: Shape
) -> tuple[Tensor, Tensor, Tensor]:
    """Keys (V_out,) of all cells that an input site reaches, the table (K, V_out), and the table (K, V_in)
    of output rows that each input row adds to. The kernel has `MOST_OFFSETS` at most."""
    geometry = ctypes.byref(Geometry(inputs, outputs, kernel, stride, padding))
    offsets, rows, keys = prod(kernel), len(keys), keys.contiguous()
    words = batch_size * prod(n + 2 for n in outputs) // 64 + 1
    occupied = torch.zeros(words, dtype=torch.int64, device="cpu")
    places = torch.empty(words, dtype=torch.int32, device="cpu")
    most = min(offsets * rows, batch_size * prod(outputs))
    sites = torch.empty(most, dtype=torch.int64, device="cpu")
    found = _call("strided_sites", keys, rows, geometry, occupied, places, words, sites)
    table = torch.empty(offsets, found, dtype=torch.int32, device="cpu")
    table_of_inputs = torch.empty(offsets, rows, dtype=torch.int32, device="cpu")
    _call("strided_tables", keys, rows, geometry, occupied, places, found, table, table_of_inputs)
    return sites[:found].clone(), table, table_of_inputs


def _require(fits: bool, *values: Tensor) -> None:
    """Raises ValueError for values that C would read as something else."""
    if not fits or any(value.dtype != torch.float32 for value in values):
        shapes = " and ".join(f"{tuple(value.shape)} {value.dtype}" for value in values)
        raise ValueError(f"a sparse convolution of {shapes} does not fit its rules")


def _padded(channels: int) -> int:
    return -(-channels // LANES) * LANES


def _call(name: str, *arguments: object) -> int:
    """Call a function of `sparse.c`, which returns a number or, for which this is 0, nothing."""
    library = compiled_library(SOURCE)
    assert library is not None
    function = getattr(library, name)
    function.restype = ctypes.c_int64 if name == "strided_sites" else None
    return function(*(_as_c(each) for each in arguments)) or 0


def _as_c(value: object) -> object:
    """An argument as C takes it: a tensor by where it begins in memory."""
    if isinstance(value, Tensor):
        return ctypes.c_void_p(value.data_ptr())
    return ctypes.c_int64(value) if isinstance(value, int) else value
