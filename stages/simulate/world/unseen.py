"""The world of a drive without instrumented vehicles, which nobody observes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import shapely

from advpipe.pipeline.sensors.world import Offer, Surroundings
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import Roads, lay_out_roads
from advpipe.stages.simulate.traffic.road_users import RoadUser


class UnseenWorld:
    """See `World`: the roads alone, laid out when they are asked for. No sensor looks at it."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self.footprints: Sequence[shapely.Polygon] = ()
        self.offers: frozenset[Offer] = frozenset()

    @cached_property
    def roads(self) -> Roads:
        """See `World`."""
        return lay_out_roads(self._network)

    def around(self, carrier: RoadUser, users: Sequence[RoadUser]) -> Surroundings:
        """Raises RuntimeError: there is no sensor in this world."""
        raise RuntimeError(f"{carrier.id} has sensors in a world that nobody observes")
