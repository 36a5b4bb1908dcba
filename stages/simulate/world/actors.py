"""The road users of the traffic and of the world together: each sees the other's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.traffic.protocol import SignalisedTraffic, TrafficSource
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.protocol import SteppedWorld, World


class WorldActors:
    """Shows the traffic to a world with actors of its own, and these to the traffic.

    The traffic reacts one step later: the world moves its actors after the traffic has moved.
    """

    def __init__(self, world: World, traffic: TrafficSource) -> None:
        self._world = world if isinstance(world, SteppedWorld) else None
        self._traffic = traffic
        self._own: frozenset[str] = frozenset()

    def route_m(self, name: str) -> Float64:
        """Points (K, 3) near which an instrumented vehicle drives."""
        own = None if self._world is None else self._world.route_m(name)
        return self._traffic.route_m(name) if own is None else own

    def advance(
        self, frame: int, drivers: Mapping[str, RoadUser], people: Sequence[RoadUser]
    ) -> tuple[dict[str, RoadUser], list[RoadUser]]:
        """All vehicles by id, and all road users, after the world has moved on to this frame."""
        traffic = {name: user for name, user in drivers.items() if name not in self._own}
        if self._world is None:
            return traffic, [*traffic.values(), *people]
        signals = self._traffic.signals() if isinstance(self._traffic, SignalisedTraffic) else {}
        own = self._world.advance(frame, [*traffic.values(), *people], signals)
        vehicles = {user.id: user for user in own if user.variant.body.label != "pedestrian"}
        self._own = frozenset(vehicles)
        self._traffic.push(vehicles.values())
        everybody = {**traffic, **vehicles}
        on_foot = [user for user in own if user.id not in vehicles]
        return everybody, [*everybody.values(), *people, *on_foot]
