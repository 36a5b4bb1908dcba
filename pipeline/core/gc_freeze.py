"""Keeps Python's garbage collector from searching long-lived objects again and again."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def gc_frozen() -> Iterator[None]:
    """Exclude the objects that exist at the start of the block from garbage collection within it.

    A loop that makes many small objects triggers collections all the time; with a world, message types and
    ASN.1 in memory, each full collection takes a tenth of a second or more.
    """
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
