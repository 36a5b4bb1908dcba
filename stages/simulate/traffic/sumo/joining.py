"""What a SUMO that somebody else started must be, and is told, before vehicles of ours drive in it."""

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
"""TraCI's, by attribute; it has none for the others, which are set as parameters."""


def prepare_server(
    sumo: SumoConnection, network: RoadNetwork, variants: Mapping[str, Variant], step_s: float
) -> None:
    """Defines our vehicle types where the server has none of their names.

    Raises AdvpipeError for a server that drives on another network or in other steps.
    """
    strange = sorted({edge.id for edge in network.drivable} - set(sumo.edge.getIDList()))
    if strange:
        raise AdvpipeError(
            f"traffic.server.join: that SUMO has no edge {strange[0]!r} and drives on another network; start "
            f"it with --net-file {network.sumo_file}"
        )
    theirs_s = sumo.simulation.getDeltaT()
    if abs(theirs_s - step_s) > 1e-9:
        raise AdvpipeError(
            f"traffic.server.join: that SUMO has steps of {theirs_s:g} s, not of {step_s:g} s; "
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
