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

    roads: the roads, beside which pedestrians walk. footprints: outlines of the buildings in the map's x-y
    plane, in metres. offers: the methods of `Surroundings` that work in this world.
    """

    @property
    def roads(self) -> Roads: ...
    @property
    def footprints(self) -> Sequence[shapely.Polygon]: ...
    @property
    def offers(self) -> frozenset[Offer]: ...

    def around(self, carrier: RoadUser, users: Sequence[RoadUser]) -> Surroundings:
        """The surroundings of one vehicle's sensors at one instant.

        users: all moving road users at that instant, including the carrier. Parked cars belong to the world.
        """
        ...


NewWorld = Callable[[Scenario, RoadNetwork, dict[str, Variant]], World]
"""Builds a world from the scenario, its road network, and the bodies of all possible road users, by name.

Raises AdvpipeError for an unusable mesh of the user.
"""
