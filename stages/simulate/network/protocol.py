"""The interface of the V2X network: which vehicle receives what, and the master clock of the simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import shapely

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.v2x.channel import Received, Rejected, Sent
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.simulate.traffic.road_users import RoadUser


@dataclass(frozen=True)
class NetworkStep:
    """The messages sent and received up to `stamp_ns` since the previous instant.

    sent: in the order of request_ns, all of them before `stamp_ns`; numbers count up through the drive.
    received: by instrumented vehicles, in the order of arrival, with power and SINR; none later
    than `stamp_ns`; later arrivals belong to a later step. rejected: by instrumented vehicles, below their
    facilities.
    """

    stamp_ns: int
    sent: tuple[Sent, ...] = ()
    received: tuple[Received, ...] = ()
    rejected: tuple[Rejected, ...] = ()


@runtime_checkable
class Network(Protocol):
    """The radios of one drive and the master clock. `NewNetwork` is the constructor's signature.

    The drive calls `simulate_until` and then `update`, once for each recorded instant, and reads `radios`
    and `local_dynamic_maps` after that; after the last instant it calls `finish` and `statistics`.
    """

    @property
    def radios(self) -> Sequence[RadioPlace]:
        """The true pose of every radio on the road since the newest `update`, by station id."""
        ...

    def simulate_until(self, stamp_ns: int) -> NetworkStep:
        """Advance to an instant, and call `step_traffic` once to move the traffic there.

        Stations send their states of the newest `update`. Up to the first instant no station is known, and
        nothing is sent, but the traffic is moved.
        """
        ...

    def update(self, drivers: Mapping[str, RoadUser], estimates: Mapping[str, Estimate]) -> None:
        """Set the vehicles now on the road, by id, and the estimates of the instrumented ones.

        Pedestrians are not included. A vehicle that is no longer in `drivers` has left the road with its
        radio.
        """
        ...

    def local_dynamic_maps(self) -> Sequence[tuple[str, LdmSnapshot]]:
        """The Local Dynamic Map of each instrumented vehicle on the road, by name."""
        ...

    def finish(self) -> NetworkStep:
        """The messages that arrive after the last instant; no more are sent."""
        ...

    def statistics(self) -> Statistics | None:
        """The drive's V2X statistics; None for a network without any."""
        ...


class Perceived(NamedTuple):
    """What a vehicle perceives: boxes in the map's frame. is_exact: without errors of measurement so far."""

    boxes: Boxes = Boxes()
    is_exact: bool = True


@runtime_checkable
class PerceivingNetwork(Protocol):
    """A network whose stations send what they perceive (`v2x.cpm`), besides the members of `Network`."""

    def set_perception(self, perceived: Callable[[RoadUser], Perceived]) -> None:
        """Set what each vehicle perceives at the newest instant; called once."""
        ...


NewNetwork = Callable[[Scenario, Callable[[], None], Sequence[shapely.Polygon] | None], Network]
"""Builds a network from the scenario, a function that moves all traffic by one step, and the footprints of
buildings that attenuate signals (None if they do not)."""
