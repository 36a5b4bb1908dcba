"""What a network needs around a drive: before the traffic starts, and after it has ended."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType

import shapely

from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.network.protocol import Network, NewNetwork
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.protocol import TrafficSource


class NetworkSession:
    """A network in this process needs nothing; one in a process of its own extends this class.

    scenario, roads: those with which the traffic is opened; they may differ from the drive's in what another
    client of SUMO needs. The session is entered before the traffic, and left after it.
    """

    def __init__(self, scenario: Scenario, roads: RoadNetwork, new_network: NewNetwork) -> None:
        self.scenario, self.roads, self._new_network = scenario, roads, new_network

    def open(self, traffic: TrafficSource, footprints: Sequence[shapely.Polygon] | None) -> Network:
        """The network of the drive, whose traffic has just been entered; see `NewNetwork`."""
        return self._new_network(self.scenario, traffic.step, footprints)

    def __enter__(self) -> NetworkSession:
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return
