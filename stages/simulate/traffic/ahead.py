"""Traffic that another process simulates ahead: for drives of messages alone, in which nothing acts on it."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping
from functools import partial
from pathlib import Path
from types import TracebackType

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.local_processes import results_ahead, usable_cores
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.packed_users import PackedUsers, UserPacker, UserUnpacker
from advpipe.stages.simulate.traffic.protocol import TrafficSource
from advpipe.stages.simulate.traffic.road_users import RoadUser

WORTH_A_PROCESS = 60_000
"""Vehicles times steps: a hundred vehicles for a minute. A process takes seconds to load its libraries."""


def pays_ahead(scenario: Scenario) -> bool:
    """Whether another process may simulate the traffic, and is worth its start."""
    traffic = scenario.traffic
    return (
        not scenario.vehicles
        and (traffic.source, traffic.transport) == ("sumo", "libsumo")
        and usable_cores() > 1
        and traffic.vehicles * scenario.simulation.frames >= WORTH_A_PROCESS
    )


class TrafficAhead(TrafficSource):
    """A source in a process of its own, a step or so ahead, for a scenario without instrumented vehicles.

    The road users are the same, bit for bit. An error of that process is raised here by the step that it
    concerns.
    """

    def __init__(
        self,
        source: type[TrafficSource],
        scenario: Scenario,
        network: RoadNetwork,
        variants: Mapping[str, Variant],
        scratch: Path,
    ) -> None:
        source(scenario, network, variants, scratch)  # checks the scenario
        self._prepare = partial(_frames, source, scenario, network, dict(variants), scratch)
        self._steps = range(scenario.simulation.frames)
        self._frames: Generator[PackedUsers, None, None] | None = None
        self._unpacker = UserUnpacker()
        self._users: dict[str, RoadUser] = {}

    def __enter__(self) -> TrafficAhead:
        self._frames = results_ahead(self._prepare, self._steps)
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._frames is not None:
            self._frames.close()

    def step(self) -> None:
        assert self._frames is not None
        self._users = {user.id: user for user in self._unpacker.unpack(next(self._frames))}

    def road_users(self) -> Mapping[str, RoadUser]:
        return self._users

    def route_m(self, name: str) -> Float64:
        raise KeyError(name)  # no vehicle carries sensors

    def push(self, users: Iterable[RoadUser], upcoming: Iterable[RoadUser] = ()) -> None:
        if any(True for _ in users):
            raise AdvpipeError("a drive of messages alone takes no external vehicles: nothing reacts to them")


def _frames(
    source_class: type[TrafficSource],
    scenario: Scenario,
    network: RoadNetwork,
    variants: Mapping[str, Variant],
    scratch: Path,
) -> Callable[[int], PackedUsers]:
    """Enter the traffic in this process, which ends with the drive; each call steps it."""
    source = source_class(scenario, network, variants, scratch).__enter__()
    packer = UserPacker()

    def frame(_: int) -> PackedUsers:
        source.step()
        return packer.pack(source.road_users().values())

    return frame
