"""The stations, messages and receptions of a drive as Artery simulates them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from advpipe.pipeline.artery.recorded_medium import RecordedMedium
from advpipe.pipeline.artery.records import (
    Arrival,
    BusyRatio,
    NewStation,
    Record,
    Transmission,
)
from advpipe.pipeline.localisation.estimate import Estimate
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace, stations_of
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.v2x.channel import Channel, Sent
from advpipe.pipeline.v2x.codec.btp import parse_btp_packet
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.facilities.ldm import LdmSnapshot
from advpipe.pipeline.v2x.geonetworking.packet import PacketError, parse_broadcast, parse_packet
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.stations import Reception
from advpipe.pipeline.v2x.stack import ReceiverStack
from advpipe.pipeline.v2x.statistics import Statistics
from advpipe.stages.simulate.network.artery.link import ArteryLink
from advpipe.stages.simulate.network.protocol import NetworkStep
from advpipe.stages.simulate.traffic.road_users import RoadUser


class ArteryNetwork:
    """See `Network`. Artery is a step ahead of the drive, and waits there for SUMO.

    Its stations know their true states, not `estimates`. Local Dynamic Maps are ours. The power of a message
    is the one that Artery's radios have. end: ends Artery, which may be called several times.
    """

    def __init__(
        self,
        scenario: Scenario,
        step_traffic: Callable[[], None],
        link: ArteryLink,
        end: Callable[[], None],
    ) -> None:
        self._clock, self._v2x = scenario.simulation, scenario.v2x
        self._step_traffic, self._link, self._end = step_traffic, link, end
        self._instrumented = tuple(sorted(scenario.vehicles))
        origin = scenario.map.origin
        geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        stack = None
        if self._v2x.has_packets:
            stack = ReceiverStack(self._v2x, self._clock.seed, self._clock.start_ns)
        self._medium = RecordedMedium()
        self.channel = Channel(self._v2x, self._clock.seed, geodesy, {}, stack=stack, medium=self._medium)
        self._stations: dict[str, NewStation] = {}
        self._power_dbm: dict[int, float] = {}
        self._sent: list[Sent] = []  # not yet due in the drive
        self._numbers: dict[int, int] = {}  # of messages, by Artery's packet
        self._messages = 0
        self._step_ns = self._clock.stamp_ns(1) - self._clock.stamp_ns(0)
        self._now_ns: int | None = None
        self.radios: tuple[RadioPlace, ...] = ()
        self._link.clock.begin(self._clock.stamp_ns(0))

    def simulate_until(self, stamp_ns: int) -> NetworkStep:
        self._step_traffic()
        self._note(self._link.wait_until(stamp_ns + self._step_ns))
        is_first, self._now_ns = self._now_ns is None, stamp_ns
        return NetworkStep(stamp_ns) if is_first else self._step(stamp_ns)

    def update(self, drivers: Mapping[str, RoadUser], estimates: Mapping[str, Estimate]) -> None:
        places = []
        for name, user in drivers.items():
            if (station := self._stations.get(name)) is not None:
                variant = user.variant
                size_m = variant.length_m, variant.width_m, variant.height_m
                places.append(
                    RadioPlace(station.station_id, name, user.map_SE3_base, size_m, user.velocity_mps)
                )
        self.radios = tuple(sorted(places, key=lambda place: place.station_id))

    def local_dynamic_maps(self) -> list[tuple[str, LdmSnapshot]]:
        assert self._now_ns is not None
        present = {place.vehicle for place in self.radios}
        names = [name for name in self._instrumented if name in present]
        return [(name, self.channel.snapshot(name, self._now_ns)) for name in names]

    def finish(self) -> NetworkStep:
        assert self._now_ns is not None
        self._end()
        result = self.channel.finish(self._now_ns, stations_of(self._v2x, self.radios))
        return NetworkStep(self._now_ns, received=result.received, rejected=result.rejected)

    def statistics(self) -> Statistics | None:
        return self.channel.statistics()

    def _step(self, until_ns: int) -> NetworkStep:
        ids = {place.station_id for place in self.radios}
        due = [one for one in self._sent if one.request_ns < until_ns]
        self._sent = self._sent[len(due) :]
        sent = tuple(one for one in due if one.station_id in ids)
        result = self.channel.advance(until_ns, stations_of(self._v2x, self.radios), sent)
        return NetworkStep(until_ns, sent, result.received, result.rejected)

    def _note(self, records: Sequence[Record]) -> None:
        """Take in what Artery has simulated in one more step, one ahead of the drive's."""
        receptions, ratios = list[Reception](), list[BusyRatio]()
        for record in records:
            if isinstance(record, NewStation):
                self._stations[record.vehicle] = record
                self._power_dbm[record.station_id] = record.power_dbm
                if record.vehicle in self._instrumented:
                    self.channel.listen(record.station_id, record.vehicle)
            elif isinstance(record, Transmission):
                self._note_sent(record)
            elif isinstance(record, Arrival) and (number := self._numbers.get(record.packet_id)) is not None:
                receptions.append(
                    Reception(number, record.station_id, record.time_ns, record.power_dbm, record.sinr_db)
                )
            elif isinstance(record, BusyRatio):
                ratios.append(record)
        self._medium.note(receptions, ratios)

    def _note_sent(self, record: Transmission) -> None:
        payload = _payload(record.packet)
        if payload is None:
            return
        key = int(message_keys(record.station_id, record.time_ns, self._messages)[()])
        self._numbers[record.packet_id] = self._messages
        packet = record.packet if self._v2x.has_packets else b""
        power_dbm = self._power_dbm[record.station_id]
        self._sent.append(
            Sent(self._messages, key, record.station_id, record.time_ns, payload, power_dbm, packet)
        )
        self._messages += 1


def _payload(packet: bytes) -> bytes | None:
    """The message in a GeoNetworking packet; None for one of GeoNetworking itself, such as a beacon."""
    try:
        return parse_btp_packet(parse_broadcast(parse_packet(packet).content).btp).payload
    except (PacketError, MessageError):
        return None
