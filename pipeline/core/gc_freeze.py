"""Keeps Python's garbage collector from searching long-lived objects again and again."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

NEW_OBJECTS = 20_000
"""So many new objects start a collection within a block, instead of Python's 700: messages are trees of small
objects, hardly any of them in a cycle."""


@contextmanager
def gc_frozen() -> Iterator[None]:
    """Exclude the objects that exist at the start of the block from garbage collection within it, which comes
    less often there.

    A loop that makes many small objects triggers collections all the time; with a world, message types and
    ASN.1 in memory, each full collection takes a tenth of a second or more.
    """
    usual = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(NEW_OBJECTS, *usual[1:])
    try:
        yield
    finally:
        gc.set_threshold(*usual)
        gc.unfreeze()
