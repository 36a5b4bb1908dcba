"""Sources of traffic by the name that `traffic.source` gives in the scenario file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import find_implementation
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.ahead import TrafficAhead, pays_ahead
from advpipe.stages.simulate.traffic.protocol import TrafficSource
from advpipe.stages.simulate.traffic.sumo.traffic import SumoTraffic
from advpipe.stages.simulate.traffic.trajectories.traffic import TrajectoryTraffic

TRAFFIC_SOURCES: Mapping[str, type[TrafficSource]] = {
    "sumo": SumoTraffic,
    "trajectories": TrajectoryTraffic,
}


def open_traffic(
    scenario: Scenario, network: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
) -> TrafficSource:
    """The source that the scenario names, ready to be entered, in a process of its own where that pays.

    Raises UsageError for an unknown name or a class that is not a `TrafficSource`, and any AdvpipeError
    that the source raises about the scenario.
    """
    name = scenario.traffic.source
    source = find_implementation("traffic.source", name, TRAFFIC_SOURCES)
    if not (isinstance(source, type) and issubclass(source, TrafficSource)):
        raise UsageError(
            f"traffic.source {name} is not a traffic source: it lacks members of "
            "stages/simulate/traffic/protocol.py"
        )
    if pays_ahead(scenario):
        return TrafficAhead(source, scenario, network, variants, scratch)
    return source(scenario, network, variants, scratch)
