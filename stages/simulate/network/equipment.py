"""Which vehicles have a V2X station: each instrumented one, and a share of the others (v2x.penetration)."""

from __future__ import annotations

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.scenario.models import Scenario


class Equipment:
    """Decides for each vehicle once, by the seed and its name, whatever the network."""

    def __init__(self, scenario: Scenario) -> None:
        self._seed, self._penetration = scenario.simulation.seed, scenario.v2x.penetration
        self._instrumented = frozenset(scenario.vehicles)
        self._equipped: dict[str, bool] = {}

    def has_station(self, name: str, can_have_one: bool) -> bool:
        """Whether a vehicle has a station. can_have_one: whether its body can, unlike a bicycle's."""
        if name not in self._equipped:
            draw = named_generator(self._seed, "v2x", "equipped", name).random()
            is_drawn = can_have_one and bool(draw < self._penetration)
            self._equipped[name] = name in self._instrumented or is_drawn
        return self._equipped[name]
