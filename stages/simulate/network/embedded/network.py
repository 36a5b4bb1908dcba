"""ETSI ITS-G5 in this process: stations that send CAMs, the radio between them, and the master clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import shapely

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import PseudonymUse, RadioPlace, stations_of
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.v2x.channel import Channel, Sent
from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.pipeline.v2x.facilities.generation import switched_on_ns
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot
from advpipe.pipeline.v2x.message_type import CAM, message_type_of
from advpipe.pipeline.v2x.radio.buildings import Buildings
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.stack import PacketBuilder, ReceiverStack
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.simulate.network.embedded.cpm_service import CpmService
from advpipe.stages.simulate.network.embedded.denm_service import DenmService
from advpipe.stages.simulate.network.embedded.hazards import Hazards
from advpipe.stages.simulate.network.embedded.service import GeneratedMessage
from advpipe.stages.simulate.network.embedded.station import Station, update_states
from advpipe.stages.simulate.network.equipment import Equipment
from advpipe.stages.simulate.network.protocol import NetworkStep, Perceived
from advpipe.stages.simulate.traffic.road_users import RoadUser


class EmbeddedNetwork:
    """See `Network`. Each step of its clock sends the due messages, and then moves the traffic."""

    def __init__(
        self,
        scenario: Scenario,
        step_traffic: Callable[[], None],
        footprints: Sequence[shapely.Polygon] | None = None,
    ) -> None:
        self._clock, self._v2x = scenario.simulation, scenario.v2x
        self._step_traffic = step_traffic
        self._instrumented = tuple(sorted(scenario.vehicles))
        origin = scenario.map.origin
        self._geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self._ids: dict[str, int] = {}
        self._used: set[int] = set()
        self._equipment = Equipment(scenario)
        listeners = {self._id_of(name): name for name in self._instrumented}
        buildings = None if footprints is None else Buildings(footprints)
        stack = (self._v2x, self._clock.seed, self._clock.start_ns) if self._v2x.has_packets else None
        self._packets = None if stack is None else PacketBuilder(*stack)
        receivers = None if stack is None else ReceiverStack(*stack)
        self.channel = Channel(
            self._v2x, self._clock.seed, self._geodesy, listeners, buildings, stack=receivers
        )
        self._hazards = Hazards()
        self._stations: dict[str, Station] = {}
        self._by_id: list[Station] = []
        self._now_ns = self._clock.stamp_ns(0)
        self._messages = 0
        self.radios: tuple[RadioPlace, ...] = ()
        self._perceived: Callable[[RoadUser], Perceived] = _nothing
        self.pseudonyms: tuple[PseudonymUse, ...] = ()

    def set_perception(self, perceived: Callable[[RoadUser], Perceived]) -> None:
        """See `PerceivingNetwork`."""
        self._perceived = perceived

    def simulate_until(self, stamp_ns: int) -> NetworkStep:
        step = self._step(stamp_ns)
        self._step_traffic()
        self._now_ns = stamp_ns
        return step

    def update(self, drivers: Mapping[str, RoadUser], estimates: Mapping[str, Estimate]) -> None:
        if not self._v2x.enabled:
            return
        clock, before = self._clock, self._stations
        self._stations = {}
        for name, user in drivers.items():
            if self._equipment.has_station(name, user.variant.body.station_type is not None):
                self._stations[name] = before.get(name) or self._new_station(name, user)
                self._stations[name].user = user
        self._by_id = sorted(self._stations.values(), key=lambda station: station.id)
        update_states(self._by_id, estimates, self._now_ns, self._v2x, clock.step_s, self._geodesy)
        changes = [self._rename(station) for station in self._by_id if station.wants_pseudonym()]
        self.pseudonyms = tuple(changes)
        for station in self._by_id:
            station.update_services(self._now_ns, drivers)
        self.radios = tuple(station.place for station in self._by_id)

    def local_dynamic_maps(self) -> list[tuple[str, LdmSnapshot]]:
        names = [name for name in self._instrumented if name in self._stations]
        return [(name, self.channel.snapshot(name, self._now_ns)) for name in names]

    def finish(self) -> NetworkStep:
        result = self.channel.finish(self._now_ns, stations_of(self._v2x, self.radios))
        return NetworkStep(self._now_ns, received=result.received, rejected=result.rejected)

    def statistics(self) -> Statistics | None:
        return self.channel.statistics() if self._v2x.enabled else None

    def _step(self, until_ns: int) -> NetworkStep:
        if until_ns == self._now_ns or not self._v2x.enabled:  # the first frame: no station is known yet
            return NetworkStep(until_ns)
        stations = self._by_id
        due = [(one, station) for station in stations for one in station.messages_before(until_ns)]
        due.sort(key=lambda item: (item[0].time_ns, item[1].id))
        times_ns = np.array([one.time_ns for one, _ in due], np.int64)
        ids = np.array([station.id for _, station in due], np.int64)
        keys = message_keys(ids, times_ns, np.array([_copy(one) for one, _ in due], np.int64))
        power_dbm = self._v2x.radio.transmit_power_dbm
        sent = tuple(
            Sent(number, key, station.id, one.time_ns, one.payload, power_dbm, self._packet(station, one))
            for number, (key, (one, station)) in enumerate(
                zip(keys.tolist(), due, strict=True), start=self._messages
            )
        )
        self._messages += len(sent)
        result = self.channel.advance(until_ns, stations_of(self._v2x, self.radios), sent)
        for load in result.loads:
            for station, busy_ratio in zip(stations, load.busy_ratio.tolist(), strict=True):
                station.update_channel_load(busy_ratio)
        return NetworkStep(until_ns, sent, result.received, result.rejected)

    def _packet(self, station: Station, message: GeneratedMessage) -> bytes:
        """The packet around a message; empty in a drive without."""
        if self._packets is None:
            return b""
        self._packets.note(station.id, message.payload)
        return self._packets.packet(station.id, message.time_ns, message.payload, message.cam)

    def _rename(self, station: Station) -> PseudonymUse:
        rng = named_generator(self._clock.seed, "v2x", "pseudonyms", station.id, station.pseudonym)
        while (pseudonym := int(rng.integers(1, 2**31))) in self._used:
            pass
        self._used.add(pseudonym)
        station.rename(pseudonym)
        return PseudonymUse(self._now_ns, station.id, pseudonym)

    def _new_station(self, name: str, user: RoadUser) -> Station:
        clock = self._clock
        active_ns = switched_on_ns(self._now_ns, clock.stamp_ns(0), clock.seed, name)
        station = Station(self._v2x, clock.seed, clock.step_s, self._id_of(name), user, active_ns)
        if self._v2x.denm is not None:
            station.services.append(DenmService(self._v2x.denm, self._hazards, clock.seed, station.id))
        if self._v2x.cpm is not None and self._sends_cpms(self._v2x.cpm, name):
            rules, perceived = self._v2x.cpm, self._perceived
            station.services.append(CpmService(rules, clock.seed, station, active_ns, perceived))
        return station

    def _sends_cpms(self, rules: CpmRules, name: str) -> bool:
        draw = named_generator(self._clock.seed, "v2x", "sends CPMs", name).random()
        return name in self._instrumented or bool(draw < rules.penetration)

    def _id_of(self, name: str) -> int:
        """A random 31-bit station id for the vehicle, unique in the drive."""
        if name not in self._ids:
            rng = named_generator(self._clock.seed, "v2x", "station id", name)
            while (station_id := int(rng.integers(1, 2**31))) in self._used:
                pass
            self._ids[name] = station_id
            self._used.add(station_id)
        return self._ids[name]


def _nothing(_: RoadUser) -> Perceived:
    return Perceived()


def _copy(message: GeneratedMessage) -> int:
    """Tells messages of several types apart that a station generates at the same time; 0 for a CAM."""
    kind = message_type_of(message.payload)
    return 0 if kind is CAM else kind.message_id
