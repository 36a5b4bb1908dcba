"""A world that a newcomer wrote from the docstrings of its protocol: a grey plane without road users on
it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.sensors.world import Float32, Hits
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import lay_out_roads
from advpipe.stages.simulate.traffic.road_users import RoadUser, boxes_of


class Flat:
    """The ground is at the height of the observing vehicle."""

    offers = frozenset({"road users", "rays"})
    footprints = ()

    def __init__(self, scenario: object, network: RoadNetwork, variants: object) -> None:
        self.roads = lay_out_roads(network)

    def around(self, carrier: RoadUser, users: Sequence[RoadUser]) -> AroundIt:
        return AroundIt(carrier, [user for user in users if user.id != carrier.id])


class AroundIt:
    def __init__(self, carrier: RoadUser, others: Sequence[RoadUser]) -> None:
        self._carrier, self._others = carrier, others

    def road_users(self, range_m: float) -> Boxes:
        place = self._carrier.position_m
        return boxes_of([u for u in self._others if np.linalg.norm(u.position_m - place) <= range_m])

    def cast(self, rays: Float32, range_m: float) -> Hits:
        with np.errstate(divide="ignore"):
            down_m = (self._carrier.position_m[2] - rays[:, 2]) / rays[:, 5]
        count = len(rays)
        return Hits(
            np.where(down_m > 0, down_m, np.inf).astype(np.float32),
            np.abs(rays[:, 5]),
            np.full(count, 0.5, np.float32),
            np.zeros(count, np.bool_),
            np.ones(count, np.float32),
            np.full(count, -1, np.int32),
            np.zeros(len(self.road_users(range_m).ids), np.float32),
        )


class Blind(Flat):
    """A world that cannot cast rays."""

    offers = frozenset({"road users"})


class Nothing:
    """No world at all."""

    def __init__(self, *_: object) -> None: ...
