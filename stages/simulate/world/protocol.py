"""The interface of the world: what sensors observe, and what else the drive needs from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import shapely

from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.sensors.world import Offer, Surroundings
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import Roads
from advpipe.stages.simulate.traffic.road_users import RoadUser


@runtime_checkable
class World(Protocol):
    """The world of one drive. `NewWorld` is the constructor's signature.

    roads: where people may walk beside them. footprints: of the buildings, on the map as seen from above.
    offers: which of the methods of `Surroundings` work in this world.
    """

    @property
    def roads(self) -> Roads: ...
    @property
    def footprints(self) -> Sequence[shapely.Polygon]: ...
    @property
    def offers(self) -> frozenset[Offer]: ...

    def around(self, carrier: RoadUser, users: Sequence[RoadUser]) -> Surroundings:
        """The surroundings of one vehicle's sensors at one instant.

        users: all that move at that instant, the carrier itself too. Who stands parked is the world's own.
        """
        ...


NewWorld = Callable[[Scenario, RoadNetwork, dict[str, Variant]], World]
"""Makes a world from the scenario, its roads, and the bodies of all who may come into it, by name.

Raises AdvpipeError for a mesh of the user's that cannot be used.
"""
