"""The networks by the name that `v2x.network` gives them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import shapely

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import find_implementation
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.network.protocol import Network, NewNetwork


def _embedded(
    scenario: Scenario, step_traffic: Callable[[], None], footprints: Sequence[shapely.Polygon] | None
) -> Network:
    from advpipe.stages.simulate.network.embedded.network import EmbeddedNetwork

    return EmbeddedNetwork(scenario, step_traffic, footprints)


NETWORKS: Mapping[str, NewNetwork] = {"embedded": _embedded}


def open_network(
    scenario: Scenario, step_traffic: Callable[[], None], footprints: Sequence[shapely.Polygon] | None
) -> Network:
    """Build the network that the scenario names; raises UsageError for an unknown or invalid one."""
    name = scenario.v2x.network
    made = find_implementation("v2x.network", name, NETWORKS)(scenario, step_traffic, footprints)
    if not isinstance(made, Network):
        raise UsageError(
            f"v2x.network {name} is not a network: it lacks members of stages/simulate/network/protocol.py"
        )
    return made
