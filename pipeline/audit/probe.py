"""A probe: a number of one unit of a bag that does not look at what attacks are about."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]

Unit = Literal["cloud", "point", "message", "station", "cpm", "fix", "scan", "return", "image", "chunk"]
"""What is attacked or clean: a LiDAR cloud, one of its points, a received CAM, the sender of CAMs by the id
that it claims, a received CPM, a GNSS fix, a radar scan, one of its returns, a camera image, and a chunk of
the file."""

V = TypeVar("V", bound=Any)


@dataclass(frozen=True)
class Probe(Generic[V]):
    """A number of each unit.

    name: unique within the unit. meaning: a noun phrase for tables. measure: the numbers (N,) of the N units
    of a view of one bag; NaN where a unit has none.
    implied_by: the quantities of attacks (`labels.quantity`) that move it by definition; an attack that may
    change one of them, by the bounds that it declares, is excused.
    """

    name: str
    unit: Unit
    meaning: str
    measure: Callable[[V], Float64]
    implied_by: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """The probe's name among all probes."""
        return f"{self.unit}/{self.name}"
