"""The seam of the V2X network: who hears what, and the clock that all of the simulation follows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import shapely

from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.v2x.channel import Received, Sent
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.simulate.traffic.road_users import RoadUser


@dataclass(frozen=True)
class NetworkStep:
    """What happened on the air up to `stamp_ns` since the instant before.

    sent: in the order of request_ns, all of them before `stamp_ns`; numbers count up through the drive.
    received: what instrumented vehicles received, in the order of arrival, with power and SINR; none later
    than `stamp_ns`, and what arrives later belongs to a later step.
    """

    stamp_ns: int
    sent: tuple[Sent, ...] = ()
    received: tuple[Received, ...] = ()


@runtime_checkable
class Network(Protocol):
    """The radios of one drive and the master clock. `NewNetwork` says what one is made from.

    The drive calls `simulate_until` and then `update`, once for each recorded instant, and reads `radios`
    and `local_dynamic_maps` after that; after the last instant it calls `finish` and `statistics`.
    """

    @property
    def radios(self) -> Sequence[RadioPlace]:
        """Every radio that is on the road from the newest `update` on, by station id, where it truly is."""
        ...

    def simulate_until(self, stamp_ns: int) -> NetworkStep:
        """Goes on to an instant, and moves the traffic there, once: `step_traffic`.

        Stations tell what they knew at the newest `update`. Up to the first instant nobody is known, and
        nothing is sent; the traffic is moved all the same.
        """
        ...

    def update(self, drivers: Mapping[str, RoadUser], estimates: Mapping[str, Estimate]) -> None:
        """Who is on the road now, by id, and what the instrumented vehicles among them believe of themselves.

        People on foot are not among the drivers. Whoever is missing has left, and its radio with it.
        """
        ...

    def local_dynamic_maps(self) -> Sequence[tuple[str, LdmSnapshot]]:
        """What each instrumented vehicle on the road has been told by radio and still believes, by name."""
        ...

    def finish(self) -> NetworkStep:
        """What still arrives after the last instant; nobody sends any more."""
        ...

    def statistics(self) -> Statistics | None:
        """The drive's V2X in numbers; None for a network that keeps none."""
        ...


NewNetwork = Callable[[Scenario, Callable[[], None], Sequence[shapely.Polygon] | None], Network]
"""Makes a network from the scenario, from what moves all traffic on by one step, and from the footprints of
the buildings that weaken signals (None where they do not)."""
