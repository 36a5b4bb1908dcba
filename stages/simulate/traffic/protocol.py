"""The interface of traffic sources: which vehicles move on the roads."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Protocol, runtime_checkable

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.road_users import RoadUser


class TrafficError(AdvpipeError):
    """The simulator of the traffic has ended, or cannot go on."""


@runtime_checkable
class SignalisedTraffic(Protocol):
    """A traffic source with traffic lights, besides `TrafficSource`."""

    def signals(self) -> Mapping[str, str]:
        """SUMO's letter (r, y, g, ...) of each traffic light, by its id in the OpenDRIVE map."""
        ...


@runtime_checkable
class TrafficSource(Protocol):
    """Moves every vehicle of one drive; `traffic.source` in the scenario file names it.

    It is constructed before anything is simulated, entered once (`with source:`), and left once, whatever
    happens. The order of calls: construct, enter, `route_m` of each vehicle that carries sensors, then `step`
    and `road_users` in turns. The network's clock is the master: it calls `step` once for each step of
    `scenario.simulation.step_s`. The first `step` after entering leads to the recording's time 0, the next
    one to `step_s`, and so on; a warm-up belongs in `__enter__`.

    A source of your own inherits from this class, so that `__enter__` and `__exit__` need to be written only
    where there is something to open and close. The same scenario and seed must give the same drive: draw
    from `advpipe.named_generator(scenario.simulation.seed, "traffic")` alone.
    """

    def __init__(
        self, scenario: Scenario, network: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
    ) -> None:
        """Check the scenario for this source, and start nothing yet.

        variants: the bodies that road users may have, by name, such as `sedan.0`; `variants_of` lists those
        of one body. scratch: a folder for files, deleted after the drive.
        Raises AdvpipeError, with a one-line message, for a scenario that it cannot simulate.
        """

    def __enter__(self) -> TrafficSource:
        """Open resources and warm up. Raises AdvpipeError if that fails, and leaves nothing open."""
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the source, also after errors and Ctrl-C."""
        return

    @abstractmethod
    def step(self) -> None:
        """Move all vehicles by one step of the scenario. Raises AdvpipeError if it cannot continue."""

    @abstractmethod
    def road_users(self) -> Mapping[str, RoadUser]:
        """Every vehicle that is on the road after the newest step, by id, always in the same order.

        Each has a pose (`map_SE3_base`, 4 x 4, x forward, its origin on the ground below the middle of the
        box), a velocity in m/s in the map's axes, a body, and the lights that are on. Vehicles of
        `scenario.vehicles` go by their names, and are there in every step; one whose `driver` is
        `trajectory` may come and go. Parked cars and pedestrians are not included.
        """

    @abstractmethod
    def route_m(self, name: str) -> Float64:
        """Points (K, 3) in the map's frame along the route of a vehicle of `scenario.vehicles`.

        Called once, after entering and before the first step. Pedestrians are placed near it, so a rough
        route is enough.
        """

    @abstractmethod
    def push(self, users: Iterable[RoadUser], upcoming: Iterable[RoadUser] = ()) -> None:
        """Set the poses of external vehicles after the next `step`.

        `road_users` then returns them as pushed, and the source's own traffic reacts to them as to any other
        vehicle. A pushed vehicle replaces one of the source's own with the same id. A vehicle that is not
        pushed again before the following step disappears with it. upcoming: vehicles that will be pushed one
        step later, for a source that must make room for them in advance.
        """
