"""The base of attacks on radars: they change the list of detections of each scan."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.scan_quantities import SCAN_QUANTITIES
from advpipe.pipeline.messages.radar import RadarReturns
from advpipe.pipeline.sensors.radar.radar import Radar
from advpipe.stages.attack.base import Attack, Traits


@dataclass(frozen=True)
class ScanContext:
    """One scan under attack. radar: the victim's, which an attacker may know. elapsed_s: since the first
    attacked scan of this span. boxes: gives the true road users, in the radar's frame; it raises AdvpipeError
    in a bag without them."""

    radar: Radar
    elapsed_s: float
    boxes: Callable[[], Boxes]


@dataclass(frozen=True)
class AttackedScan:
    """returns: (K,) of `RETURN_DTYPE`, in any order: they are sorted as the given scan is. source: (K,), the
    index of each in the given scan, -1 of those added."""

    returns: RadarReturns
    source: npt.NDArray[np.int64]


ScanAttacker = Callable[[RadarReturns, ScanContext], AttackedScan]
"""Changes one scan (N,); called for each attacked scan of one radar in order."""


@dataclass(frozen=True, kw_only=True)
class RadarTraits(Traits):
    """Properties of an attack on radars that do not depend on its parameters."""


class RadarAttack(Attack):
    """An attack on the radars of a victim. Its constructor takes and checks keyword-only parameters, with
    defaults and units in their names; `radar` is the name of the attacked one, "" for all of the victim.

    >>> class Blind(RadarAttack):
    ...     traits = RadarTraits()
    ...
    ...     def __init__(self, *, radar: str = "") -> None:
    ...         self.radar = radar
    ...
    ...     def begin(self, rng):
    ...         return lambda returns, context: kept_returns(returns, np.zeros(len(returns), bool))

    `bounds` are the limits that it keeps: a scan beyond them is refused, and `verify` measures them again.
    """

    family = "radar"
    family_title = "Radar: add, delete or jam the detections of a vehicle's radars"
    usual_options = "--victim ego"
    traits_type = RadarTraits
    quantities = SCAN_QUANTITIES
    radar: str = ""

    @property
    @abstractmethod
    def traits(self) -> RadarTraits: ...

    @property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Minimum and maximum of each quantity that the attack bounds, in every attacked scan, by names of
        `advpipe.pipeline.labels.scan_quantities`; empty if it bounds none."""
        return {}

    @abstractmethod
    def begin(self, rng: np.random.Generator) -> ScanAttacker:
        """Start the attack on one radar; all random draws come from `rng`."""


def kept_returns(returns: RadarReturns, kept: npt.NDArray[np.bool_]) -> AttackedScan:
    """The scan with some of its returns (N,) alone."""
    return AttackedScan(returns[kept], np.flatnonzero(kept))


def with_added(returns: RadarReturns, added: RadarReturns) -> AttackedScan:
    """The scan with further returns (K,) after its own (N,)."""
    source = np.concatenate([np.arange(len(returns)), np.full(len(added), -1)])
    return AttackedScan(np.concatenate([returns, added]), source)
