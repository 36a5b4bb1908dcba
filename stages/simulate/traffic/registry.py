"""Sources of traffic by the name that `traffic.source` gives in the scenario file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.plugins import users_class
from advpipe.pipeline.core.shown import shown
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.protocol import TrafficSource
from advpipe.stages.simulate.traffic.sumo.traffic import SumoTraffic
from advpipe.stages.simulate.traffic.trajectories.traffic import TrajectoryTraffic

TRAFFIC_SOURCES: Mapping[str, type[TrafficSource]] = {
    "sumo": SumoTraffic,
    "trajectories": TrajectoryTraffic,
}

_METHODS = ("__enter__", "__exit__", "step", "road_users", "route_m", "push")


def open_traffic(
    scenario: Scenario, network: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
) -> TrafficSource:
    """The source that the scenario names, ready to be entered.

    Raises UsageError for a name that is none and a class of the user's that is no source, and whatever
    AdvpipeError the source itself raises about the scenario.
    """
    return traffic_source(scenario.traffic.source)(scenario, network, variants, scratch)


def traffic_source(name: str) -> type[TrafficSource]:
    """The class of a name, or of `module:Class`."""
    if name in TRAFFIC_SOURCES:
        return TRAFFIC_SOURCES[name]
    if ":" not in name:
        known = ", ".join(TRAFFIC_SOURCES)
        raise UsageError(
            f"traffic.source: {shown(name)} is no source of traffic; known: {known}, or module:Class"
        )
    found = users_class(name, "traffic source")
    if not (isinstance(found, type) and issubclass(found, TrafficSource)):
        lacking = ", ".join(method for method in _METHODS if not callable(getattr(found, method, None)))
        raise UsageError(
            f"traffic.source: {name} is no source of traffic: it lacks {lacking or 'a class'}; "
            f"inherit from {TrafficSource.__module__}.{TrafficSource.__name__}"
        )
    return found
