"""One check of a CARLA server, and its outcome."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, one_line


@dataclass(frozen=True)
class CarlaFinding:
    """One check: what was seen, and whether it is what advpipe relies on."""

    name: str
    is_good: bool
    seen: str

    def __str__(self) -> str:
        return f"{'ok  ' if self.is_good else 'FAIL'}  {self.name}: {self.seen}"


def require(is_so: bool | np.bool_, otherwise: str) -> None:
    """Raise AdvpipeError, as whose text a check has failed."""
    if not is_so:
        raise AdvpipeError(otherwise)


def finding(name: str, step: Callable[[], str]) -> CarlaFinding:
    """The outcome of one check; whatever the client raises is a failure of it."""
    try:
        return CarlaFinding(name, True, step())
    except (AdvpipeError, RuntimeError) as error:
        return CarlaFinding(name, False, one_line(error))
