"""Externally moved vehicles and their images in SUMO, to which its traffic reacts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.connection import SumoConnection
from advpipe.stages.simulate.traffic.sumo.pose import front_of

MATCH_M = 8.0
"""SUMO maps a front bumper to a lane whose centre line is this near; farther off it is beside the road."""


class ExternalVehicles:
    """Images in SUMO of externally moved vehicles, placed at their true poses before each of its steps.

    SUMO only lets its own traffic react to the images; the true poses are kept outside, and SUMO's state of
    an image off the roads is ignored. SUMO can move an image only one step after its insertion, so images are
    announced one step ahead and inserted where there is most room.
    """

    def __init__(self, sumo: SumoConnection, network: RoadNetwork) -> None:
        self._sumo, self._network = sumo, network
        self._images: set[str] = set()

    @property
    def images(self) -> set[str]:
        """Ids of the images in SUMO."""
        return self._images

    def announce(self, users: Iterable[RoadUser]) -> None:
        """Announce vehicles that will exist after SUMO's next step; call it before that step."""
        loaded = set(self._sumo.vehicle.getLoadedIDList())
        for user in users:
            if user.id in loaded:
                continue
            edge = self._emptiest_edge()
            route = f"image.{edge}"
            if route not in self._sumo.route.getIDList():
                self._sumo.route.add(route, [edge])
            self._sumo.vehicle.add(
                user.id,
                route,
                typeID=user.variant.name,
                departLane="random",
                departPos="random_free",
                departSpeed="0",
            )
            self._sumo.vehicle.setLaneChangeMode(user.id, 0)
            self._images.add(user.id)

    def move(self, users: Mapping[str, RoadUser]) -> None:
        """Move every image to its vehicle's place and remove those of absent vehicles; call it before SUMO's
        step.

        A vehicle that SUMO has inserted itself becomes an image if it is among `users`.
        """
        vehicle = self._sumo.vehicle
        inserted = set(vehicle.getIDList())
        self._images |= inserted & users.keys()
        for name in sorted(self._images - users.keys()):
            if name in vehicle.getLoadedIDList():
                vehicle.remove(name)
            self._images.discard(name)
        for name, user in users.items():
            if name not in inserted:  # SUMO found no room yet, or removed it when it left the roads
                continue
            front_m, angle_deg, _ = front_of(user.map_SE3_base, user.variant.length_m)
            front_m = front_m + self._network.offset_m
            vehicle.moveToXY(
                name, "", -1, float(front_m[0]), float(front_m[1]), angle_deg, keepRoute=2,
                matchThreshold=MATCH_M,
            )  # fmt: skip
        self.announce(users.values())

    def set_speeds(self, users: Mapping[str, RoadUser]) -> None:
        """Set the true speeds, which SUMO would derive from the images' moves; call it after SUMO's step."""
        inserted = set(self._sumo.vehicle.getIDList())
        for name, user in users.items():
            if name in inserted:
                speed_mps = float(np.linalg.norm(user.velocity_mps))
                self._sumo.vehicle.setPreviousSpeed(name, speed_mps)

    def _emptiest_edge(self) -> str:
        def density(edge: tuple[str, float]) -> tuple[float, str]:
            return (self._sumo.edge.getLastStepVehicleNumber(edge[0]) + 1) / edge[1], edge[0]

        return min(((edge.id, edge.length_m) for edge in self._network.drivable), key=density)[0]
