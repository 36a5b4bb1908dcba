"""Python's garbage collector, kept from looking again and again through what is there to stay."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def gc_frozen() -> Iterator[None]:
    """What exists at the beginning of the block is not searched for garbage within it.

    A loop over many small objects sets off collections all the time; with a world, message types and ASN.1
    in memory, each of the thorough ones takes a tenth of a second or more.
    """
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
