"""How many threads PyTorch computes with: fixed, so that results do not hang on the machine's load."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

TORCH_THREADS = 1
"""Sums depend on the number of threads, and two threads on two busy cores are slower than one."""


@contextmanager
def fixed_torch_threads(count: int = TORCH_THREADS) -> Iterator[None]:
    """PyTorch on `count` threads inside the block, and as before after it."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
