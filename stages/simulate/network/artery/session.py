"""Artery around a drive: it is SUMO's other client, so it starts before the traffic and ends with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

import shapely

from advpipe.pipeline.artery.process import ArteryProcess, artery_program
from advpipe.pipeline.artery.records import VehicleAnswer, VehicleQuestion
from advpipe.pipeline.core.progress import working_on
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.scenario.traffic import SumoServer
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.network.artery.configuration import check_supported, write_configuration
from advpipe.stages.simulate.network.artery.georeference import georeferenced
from advpipe.stages.simulate.network.artery.link import ArteryLink
from advpipe.stages.simulate.network.artery.network import ArteryNetwork
from advpipe.stages.simulate.network.equipment import Equipment
from advpipe.stages.simulate.network.protocol import Network
from advpipe.stages.simulate.network.session import NetworkSession
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.ports import LOCALHOST, free_port
from advpipe.stages.simulate.traffic.protocol import TrafficError, TrafficSource

ARTERYS_TURN = 1
"""Artery is SUMO's first client: it simulates a step before anybody else may talk to SUMO."""

WITHOUT_STATION = ("bicycle", "pedestrian", "wheelchair")
"""Classes of SUMO whose road users carry no radio."""

NOTICED_S = 2.0
"""SUMO may notice the end of Artery before the thread does that watches it."""

SUMO_IS_GONE = "tcpip::Socket"
"""In the words of SUMO's client library, which Artery uses: then SUMO has the better reason."""


class ArterySession(NetworkSession):
    """See `NetworkSession`. Raises UsageError for a scenario that Artery cannot simulate, and without it."""

    def __init__(
        self, scenario: Scenario, roads: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
    ) -> None:
        check_supported(scenario)
        self._program = artery_program(scenario.artery)
        self._folder = scratch / "artery"
        self._folder.mkdir()
        self._sumo, server = _shared_server(scenario.traffic.server)
        traffic = scenario.traffic.model_copy(update={"transport": "traci", "server": server})
        self.scenario = scenario.model_copy(update={"traffic": traffic})
        self.roads = georeferenced(roads, scenario.map.origin, self._folder)
        self._variants, self._equipment = variants, Equipment(scenario)
        self._link: ArteryLink | None = None
        self._process: ArteryProcess | None = None

    def __enter__(self) -> ArterySession:
        self._link = ArteryLink(self._station_of, self.scenario.artery.timeout_s)
        try:
            write_configuration(
                self.scenario, self._folder, sumo=self._sumo, order=ARTERYS_TURN, port=self._link.port
            )
            self._process = ArteryProcess(self._program, self._folder)
            with working_on("starting Artery"):
                self._link.watch(self._process, self._sumo)
                self._link.wait_for_hello()
        except BaseException:
            self._end()
            raise
        return self

    def open(self, traffic: TrafficSource, footprints: Sequence[shapely.Polygon] | None) -> Network:
        assert self._link is not None
        traffic.road_users()  # SUMO answers when Artery has simulated the step after the warm-up
        self._link.wait_for_rest()
        return ArteryNetwork(self.scenario, traffic.step, self._link, self._end)

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        failure = None
        if isinstance(error, TrafficError) and self._link is not None:
            failure = self._link.failure_within(NOTICED_S)
        self._end()
        if failure is not None and SUMO_IS_GONE not in str(failure):
            raise failure from None  # SUMO, which ends with Artery, cannot tell why

    def _end(self) -> None:
        """End Artery, which has nothing to save, and then the thread that watches it."""
        if self._link is not None:
            self._link.end_watch()
        if self._process is not None:
            self._process.kill()
        if self._link is not None:
            self._link.close()

    def _station_of(self, question: VehicleQuestion) -> VehicleAnswer:
        """A vehicle of ours has a type by the name of its variant; of one of the user's, the class counts."""
        if (variant := self._variants.get(question.type)) is not None:
            can_have_one = variant.body.station_type is not None
        else:
            can_have_one = question.vclass not in WITHOUT_STATION
        if not self._equipment.has_station(question.vehicle, can_have_one):
            return VehicleAnswer.NO_STATION
        is_instrumented = question.vehicle in self.scenario.vehicles
        return VehicleAnswer.STATION_AT_ONCE if is_instrumented else VehicleAnswer.STATION


def _shared_server(wanted: SumoServer) -> tuple[tuple[str, int], SumoServer]:
    """Host and port of the SUMO that both share, and how the traffic connects to it.

    Raises AdvpipeError if the port that the scenario names is in use.
    """
    order = max(wanted.order, ARTERYS_TURN + 1)
    if wanted.join is not None:
        host, _, port = wanted.join.rpartition(":")
        return (host, int(port)), wanted.model_copy(update={"order": order})
    free = free_port(wanted.port)
    clients = wanted.clients + 1
    return (LOCALHOST, free), wanted.model_copy(update={"port": free, "clients": clients, "order": order})
