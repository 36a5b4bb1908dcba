"""Vehicles that are moved from outside, as SUMO's traffic meets them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.pose import front_of

MATCH_M = 8.0
"""A bumper this near to a lane's centre line is on that road for SUMO; farther off it is beside it."""


class Puppets:
    """Their images in SUMO, put to their true places before each of its steps.

    The truth stays outside: SUMO only lets its own traffic react to it, and what it makes of an image on
    a place off every road is nobody's concern. An image has to be in SUMO for a step before it can be
    moved, so it is announced one step ahead and enters where there is most room.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._images: set[str] = set()

    @property
    def images(self) -> set[str]:
        """Ids that SUMO has been told of."""
        return self._images

    def adopt(self, name: str) -> None:
        """From now on, a vehicle that SUMO has inserted itself is moved from outside."""
        self._images.add(name)

    def announce(self, users: Iterable[RoadUser]) -> None:
        """Tells SUMO of vehicles that will be there after its next step; before that step."""
        import libsumo

        loaded = set(libsumo.vehicle.getLoadedIDList())
        for user in users:
            if user.id in loaded:
                continue
            edge = self._emptiest_edge()
            route = f"image.{edge}"
            if route not in libsumo.route.getIDList():
                libsumo.route.add(route, [edge])
            libsumo.vehicle.add(
                user.id,
                route,
                typeID=user.variant.name,
                departLane="random",
                departPos="random_free",
                departSpeed="0",
            )
            libsumo.vehicle.setLaneChangeMode(user.id, 0)
            self._images.add(user.id)

    def move(self, users: Mapping[str, RoadUser]) -> None:
        """Puts every image to its place, takes away those that are gone; before SUMO's step."""
        import libsumo

        inserted = set(libsumo.vehicle.getIDList())
        for name in sorted(self._images - users.keys()):
            if name in libsumo.vehicle.getLoadedIDList():
                libsumo.vehicle.remove(name)
            self._images.discard(name)
        for name, user in users.items():
            if name not in inserted:  # SUMO found no room yet, or dropped it on its way off the roads
                continue
            front_m, angle_deg, _ = front_of(user.map_SE3_base, user.variant.length_m)
            front_m = front_m + self._network.offset_m
            libsumo.vehicle.moveToXY(
                name, "", -1, float(front_m[0]), float(front_m[1]), angle_deg, keepRoute=2,
                matchThreshold=MATCH_M,
            )  # fmt: skip
        self.announce(users.values())

    def set_speeds(self, users: Mapping[str, RoadUser]) -> None:
        """Gives images their true speeds, which SUMO would derive from how far they moved; after its step."""
        import libsumo

        inserted = set(libsumo.vehicle.getIDList())
        for name, user in users.items():
            if name in inserted:
                speed_mps = float(np.linalg.norm(user.velocity_mps))
                libsumo.vehicle.setPreviousSpeed(name, speed_mps)

    def _emptiest_edge(self) -> str:
        import libsumo

        def crowd(edge: tuple[str, float]) -> tuple[float, str]:
            return (libsumo.edge.getLastStepVehicleNumber(edge[0]) + 1) / edge[1], edge[0]

        return min(((edge.id, edge.length_m) for edge in self._network.drivable), key=crowd)[0]
