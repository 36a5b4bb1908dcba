"""Replays the V2X messages of a recorded drive through the radio medium and the Local Dynamic Maps."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from advpipe.pipeline.bag.footprints import footprints_of_text
from advpipe.pipeline.bag.latched import V2xInfo, latched_text, read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.message_bounds import LATEST_NS
from advpipe.pipeline.messages.topics import SCENARIO_INFO, V2X_BUILDINGS, V2X_PACKETS, V2X_SENT, V2X_STATIONS
from advpipe.pipeline.messages.v2x import RadioPlace, sent_of_message, stations_of, stations_of_message
from advpipe.pipeline.v2x.channel import Channel, ChannelResult, RadioMedium, Received, Sent
from advpipe.pipeline.v2x.codec.codec import CamTree
from advpipe.pipeline.v2x.radio.buildings import Buildings
from advpipe.pipeline.v2x.stack import ReceiverStack

REPLAYED = ("embedded", "artery")
"""The networks whose drives are replayed through the embedded network's medium."""

LONGEST_STEP_NS = 10_000_000_000
"""Simulated steps last at most a second; steps are longer in a bag that has lost a few messages."""


class V2xStep(NamedTuple):
    """One step of the drive, during which radios do not move.

    end_ns: None for the last step, in which nothing is sent. sent: in the order of their request times.
    """

    begin_ns: int
    end_ns: int | None
    radios: tuple[RadioPlace, ...]
    sent: tuple[Sent, ...]


class V2xDrive:
    """The V2X of a bag that `simulate` recorded; only one step is in memory at a time.

    >>> drive = V2xDrive(BagReader(path))
    >>> channel = drive.channel()
    >>> for step in drive.steps():
    ...     result = drive.send(channel, step, step.sent)  # or other messages instead

    v2x, seed, origin: those of the scenario. stations: names of all vehicles with a radio, by station id.
    listeners: the instrumented ones among them. until_ns: steps after the one that contains this time are not
    read. Raises UsageError for a bag without V2X.
    """

    def __init__(self, reader: BagReader, until_ns: int | None = None) -> None:
        for topic in (SCENARIO_INFO, V2X_STATIONS):
            if topic.name not in reader.topics:
                raise UsageError(f"{reader.path} has no {topic.name}, so there is no V2X to replay")
        self._reader, self._until_ns = reader, until_ns
        info: V2xInfo = read_scenario_info(reader, V2xInfo)
        self.v2x, self.origin, self.seed = info.v2x, info.map.origin, info.simulation.seed
        self.start_ns = info.simulation.start_ns
        self.stations = read_stations(reader, until_ns)
        self.listeners = {number: name for number, name in self.stations.items() if name in info.vehicles}

    @property
    def geodesy(self) -> Geodesy:
        """The map's frame on the Earth."""
        return Geodesy(self.origin.latitude_deg, self.origin.longitude_deg, self.origin.altitude_m)

    def channel(
        self, decoder: Callable[[bytes], CamTree] | None = None, medium: RadioMedium | None = None
    ) -> Channel:
        """The medium and the Local Dynamic Maps in their state at the start of the drive.

        decoder: see `Channel`. medium: ours by default, with the settings of the recording, also for a drive
        that Artery simulated. Raises UsageError for a drive with a network of somebody
        else's, which may mean anything by these settings.
        """
        if self.v2x.network not in REPLAYED:
            raise UsageError(
                f"{self._reader.path} was recorded with v2x.network {self.v2x.network}; messages can be "
                "replayed through the embedded network only"
            )
        stack = ReceiverStack(self.v2x, self.seed, self.start_ns) if self.v2x.has_packets else None
        buildings = self._buildings() if medium is None else None
        return Channel(self.v2x, self.seed, self.geodesy, self.listeners, buildings, decoder, stack, medium)

    def steps(self) -> Iterator[V2xStep]:
        """Yield all steps of the drive, as `read_steps` does."""
        return read_steps(self._reader, self._until_ns)

    def sent_again(self, listeners: Collection[int]) -> Iterator[tuple[V2xStep, tuple[Received, ...]]]:
        """Yield each recorded step with the messages that these stations receive when it is sent again.

        Use it for vehicles without instruments; the receptions of instrumented vehicles are in the bag
        (`bag/receptions.py`).
        """
        self.listeners = {number: self.stations[number] for number in sorted(listeners)}
        channel = self.channel()
        for step in self.steps():
            yield step, self.send(channel, step, step.sent).received if listeners else ()

    def send(self, channel: Channel, step: V2xStep, sent: Sequence[Sent]) -> ChannelResult:
        """Advance the channel through one step in which these messages are sent."""
        stations = stations_of(self.v2x, step.radios)
        if step.end_ns is None:
            return channel.finish(step.begin_ns, stations)
        return channel.advance(step.end_ns, stations, sent)

    def _buildings(self) -> Buildings | None:
        if V2X_BUILDINGS.name not in self._reader.topics:
            return None
        where = f"{self._reader.path}: {V2X_BUILDINGS.name} holds no footprints"
        return Buildings(footprints_of_text(latched_text(self._reader, V2X_BUILDINGS.name), where))


def read_steps(reader: BagReader, until_ns: int | None = None) -> Iterator[V2xStep]:
    """Yield all steps of a recorded drive in order, with `until_ns` up to the first that ends then or later.

    Yields none for a bag without the stations' positions. Raises AdvpipeError for a message that no station
    of its step can have sent, for two messages with the same number, for a step longer than
    `LONGEST_STEP_NS`, and for a step later than `LATEST_NS`.
    """
    begin_ns: int | None = None
    radios: tuple[RadioPlace, ...] = ()
    sent: list[Sent] = []
    numbers: set[int] = set()
    packets: dict[int, bytes] = {}
    optional = [V2X_PACKETS.name] if V2X_PACKETS.name in reader.topics else []
    for raw in reader.raw_messages([V2X_STATIONS.name, V2X_SENT.name, *optional]):
        message = reader.decode(raw)
        if raw.topic.name == V2X_PACKETS.name:
            packets[message.number] = bytes(message.data)
            continue
        if raw.topic.name == V2X_SENT.name:
            sent.append(sent_of_message(message))
            if sent[-1].number in numbers:
                raise _wrong(reader, raw, f"has the number {sent[-1].number} of an earlier message")
            numbers.add(sent[-1].number)
            continue
        if raw.log_time_ns > LATEST_NS:
            raise _wrong(reader, raw, "is after January 2038, where ROS time stamps end")
        if begin_ns is not None:
            if raw.log_time_ns <= begin_ns:
                raise _wrong(reader, raw, "is not later than the one before it")
            if (lasted_ns := raw.log_time_ns - begin_ns) > LONGEST_STEP_NS:
                late = f"comes {lasted_ns / 1e9:,.1f} s after the one before it"
                raise _wrong(reader, raw, f"{late}; no step lasts over {LONGEST_STEP_NS / 1e9:g} s")
            due = [one for one in sent if one.request_ns < raw.log_time_ns]
            _check(reader, due, begin_ns, radios)
            due = [replace(one, packet=packets.pop(one.number, b"")) for one in due] if packets else due
            yield V2xStep(begin_ns, raw.log_time_ns, radios, tuple(due))
            if until_ns is not None and raw.log_time_ns >= until_ns:
                return
            sent = [one for one in sent if one.request_ns >= raw.log_time_ns]
        begin_ns, radios = raw.log_time_ns, stations_of_message(message)
    if begin_ns is not None:
        yield V2xStep(begin_ns, None, radios, ())


def _check(reader: BagReader, sent: Sequence[Sent], begin_ns: int, radios: Sequence[RadioPlace]) -> None:
    present = {radio.station_id for radio in radios}
    for one in sent:
        where = f"{reader.path}: message {one.number} of {V2X_SENT.name}"
        if one.station_id not in present:
            raise AdvpipeError(
                f"{where} was sent by station {one.station_id}, which {V2X_STATIONS.name} does not list "
                f"at {begin_ns} ns; record it again"
            )
        if one.request_ns < begin_ns:
            raise AdvpipeError(
                f"{where} is stamped {one.request_ns} ns, before its step began at {begin_ns} ns; record "
                "it again"
            )


def _wrong(reader: BagReader, raw: RawMessage, what: str) -> AdvpipeError:
    return AdvpipeError(
        f"{reader.path}: the message of {raw.topic.name} at {raw.log_time_ns} ns {what}; record it again"
    )


def read_stations(reader: BagReader, last_ns: int | None = None) -> dict[int, str]:
    """The names of all stations of a drive by station id; empty for a bag without the stations' positions.

    Raises AdvpipeError if a station id has two names or a name two station ids.
    """
    names: dict[int, str] = {}
    ids: dict[str, int] = {}
    if V2X_STATIONS.name not in reader.topics:
        return names
    for time_ns, message in reader.messages(V2X_STATIONS.name, last_ns):
        for station in message.stations:
            number, name = station.station_id, station.vehicle
            if names.setdefault(number, name) != name or ids.setdefault(name, number) != number:
                raise AdvpipeError(
                    f"{reader.path}: {V2X_STATIONS.name} at {time_ns} ns has the station {number} as "
                    f"{name!r}, earlier {names[number]!r} as {ids.get(name, number)}; record it again"
                )
    return names
