"""The interface of the world: what sensors observe, and what else the drive needs from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Protocol, runtime_checkable

import shapely

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.measurements import SensedMotion
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


@runtime_checkable
class SteppedWorld(Protocol):
    """A world with a clock and actors of its own, such as another simulator's, besides `World`.

    It is entered before the traffic is, and left after it, whatever happens.
    """

    def __enter__(self) -> object:
        """Connect. Raises AdvpipeError if that fails, and leaves nothing changed."""
        ...

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def route_m(self, name: str) -> Float64 | None:
        """Points (K, 3) in the map's frame near which a vehicle drives; None for one that it does not
        drive."""
        ...

    def advance(self, frame: int, users: Sequence[RoadUser], signals: Mapping[str, str]) -> list[RoadUser]:
        """Move its clock on to a recorded instant, with these road users at their places, and return its own.

        users: all that move in the drive, except for the world's own. signals: see `SignalisedTraffic`.
        Raises AdvpipeError if it cannot continue.
        """
        ...


@runtime_checkable
class SensingSurroundings(Protocol):
    """The surroundings in a world with GNSS and IMU of its own."""

    def sensed(self) -> SensedMotion:
        """Their readings now."""
        ...


NewWorld = Callable[[Scenario, RoadNetwork, dict[str, Variant]], World]
"""Builds a world from the scenario, its road network, and the bodies of all possible road users, by name.

Raises AdvpipeError for an unusable mesh of the user.
"""
