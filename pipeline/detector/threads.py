"""A fixed number of PyTorch threads, so that results do not depend on the machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

TORCH_THREADS = 1
"""Sums depend on the number of threads, and two threads on two busy cores are slower than one."""


@contextmanager
def fixed_torch_threads(count: int = TORCH_THREADS) -> Iterator[None]:
    """Run PyTorch on `count` threads inside the block, and restore the former number afterwards."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
