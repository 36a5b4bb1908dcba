"""The networks by the name that `v2x.network` gives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import shapely

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import find_implementation
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.network.protocol import Network
from advpipe.stages.simulate.network.session import NetworkSession
from advpipe.stages.simulate.road_network.network import RoadNetwork

NewSession = Callable[[Scenario, RoadNetwork, Mapping[str, Variant], Path], NetworkSession]
"""Prepares a network from the scenario, its roads, the bodies of road users, and a folder for files."""


def _embedded(
    scenario: Scenario, roads: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
) -> NetworkSession:
    def new_network(
        scenario: Scenario, step_traffic: Callable[[], None], footprints: Sequence[shapely.Polygon] | None
    ) -> Network:
        from advpipe.stages.simulate.network.embedded.network import EmbeddedNetwork

        return EmbeddedNetwork(scenario, step_traffic, footprints)

    return NetworkSession(scenario, roads, new_network)


def _artery(
    scenario: Scenario, roads: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
) -> NetworkSession:
    from advpipe.stages.simulate.network.artery.session import ArterySession

    if not scenario.v2x.enabled:  # there is nothing to simulate
        return _embedded(scenario, roads, variants, scratch)
    return ArterySession(scenario, roads, variants, scratch)


NETWORKS: Mapping[str, NewSession] = {"embedded": _embedded, "artery": _artery}


def prepare_network(
    scenario: Scenario, roads: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
) -> NetworkSession:
    """Prepare the network that the scenario names; raises UsageError for an unknown or invalid one."""
    name = scenario.v2x.network
    if name in NETWORKS:
        return NETWORKS[name](scenario, roads, variants, scratch)

    find: Callable[..., object] = find_implementation("v2x.network", name, NETWORKS)

    def new_network(
        scenario: Scenario, step_traffic: Callable[[], None], footprints: Sequence[shapely.Polygon] | None
    ) -> Network:
        made = find(scenario, step_traffic, footprints)
        if not isinstance(made, Network):
            raise UsageError(
                f"v2x.network {name} is not a network: it lacks members of "
                "stages/simulate/network/protocol.py"
            )
        return made

    return NetworkSession(scenario, roads, new_network)
