"""What SUMO refuses, in one line of ours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from advpipe.pipeline.core.errors import AdvpipeError


@contextmanager
def sumo_errors() -> Iterator[None]:
    """Turns the two errors of libsumo into AdvpipeError."""
    import libsumo

    try:
        yield
    except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
        raise AdvpipeError(f"SUMO cannot go on with this network or traffic: {error}") from None
