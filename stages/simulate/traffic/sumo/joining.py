"""Checks and set-up of a SUMO server that another program started, before our vehicles are inserted."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.sumo.connection import SumoConnection
from advpipe.stages.simulate.traffic.sumo.vehicle_types import type_attributes

SETTERS = {
    "vClass": "setVehicleClass",
    "length": "setLength",
    "width": "setWidth",
    "height": "setHeight",
    "maxSpeed": "setMaxSpeed",
    "accel": "setAccel",
    "latAlignment": "setLateralAlignment",
    "minGapLat": "setMinGapLat",
}
"""TraCI's setter of each attribute; attributes without a setter are set as parameters."""


def prepare_server(
    sumo: SumoConnection, network: RoadNetwork, variants: Mapping[str, Variant], step_s: float
) -> None:
    """Define our vehicle types on a server that lacks them.

    Raises AdvpipeError for a server with another network or another step length.
    """
    missing = sorted({edge.id for edge in network.drivable} - set(sumo.edge.getIDList()))
    if missing:
        raise AdvpipeError(
            f"traffic.server.join: the server has no edge {missing[0]!r}, so it runs another network; start "
            f"it with --net-file {network.sumo_file}"
        )
    server_step_s = sumo.simulation.getDeltaT()
    if abs(server_step_s - step_s) > 1e-9:
        raise AdvpipeError(
            f"traffic.server.join: the server has steps of {server_step_s:g} s, not of {step_s:g} s; "
            f"start it with --step-length {step_s:g}"
        )
    types = sumo.vehicletype
    known = set(types.getIDList())
    for name in sorted(variants.keys() - known):
        types.copy("DEFAULT_VEHTYPE", name)
        for key, value in type_attributes(variants[name]).items():
            if key in SETTERS:
                getattr(types, SETTERS[key])(name, value)
            else:
                types.setParameter(name, key, str(value))
