"""The worlds by the name that the scenario's key `world` gives them."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import find_implementation
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.world.protocol import NewWorld, World
from advpipe.stages.simulate.world.unseen import UnseenWorld


def _raycast(scenario: Scenario, network: RoadNetwork, variants: dict[str, Variant]) -> World:
    from advpipe.stages.simulate.world.raycast.world import RaycastWorld

    return RaycastWorld(scenario, network, variants)


def _carla(scenario: Scenario, network: RoadNetwork, variants: dict[str, Variant]) -> World:
    from advpipe.stages.simulate.world.carla.world import CarlaWorld

    return CarlaWorld(scenario, network, variants)


WORLDS: Mapping[str, NewWorld] = {"raycast": _raycast, "carla": _carla}


def build_world(scenario: Scenario, network: RoadNetwork, variants: dict[str, Variant]) -> World:
    """Build the world that the scenario names; nothing but its roads where nobody observes it.

    Raises UsageError for an unknown or invalid world, and for one that lacks what the sensors need.
    """
    name = scenario.world
    if name in WORLDS and not scenario.vehicles and scenario.v2x.radio.building_loss == "none":
        return UnseenWorld(network)
    made = find_implementation("world", name, WORLDS)(scenario, network, variants)
    if not isinstance(made, World):
        raise UsageError(
            f"world {name} is not a world: it lacks members of stages/simulate/world/protocol.py"
        )
    for vehicle in scenario.vehicles:
        for key, section in scenario.sensors.mounted_by(vehicle):
            if missing := section.missing_from(made.offers):
                raise UsageError(f"sensors.{key} need {missing[0]}, which the world {name} does not offer")
    return made
