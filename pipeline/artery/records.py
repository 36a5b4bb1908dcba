"""What our module in Artery tells: records over a local socket, little-endian, each after its length.

The module is `module/NodeManager.cc`, which has the same `PROTOCOL`. Times are Artery's, in nanoseconds from
the start of its simulation.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from enum import Enum
from typing import NamedTuple

from advpipe.pipeline.core.errors import AdvpipeError

PROTOCOL = 1
LONGEST_RECORD = 1 << 16


class Hello(NamedTuple):
    """The first record. version: of OMNeT++."""

    protocol: int
    version: str


class StepBegun(NamedTuple):
    """SUMO's step to this time is over, and Artery simulates the next one; it waits for an answer.

    The answer is the UTC date of Artery's time 0 from the step on with which the drive begins, and empty
    before.
    """

    time_ns: int


class StepDone(NamedTuple):
    """Everything before this time is simulated, and Artery waits for SUMO's step to it."""

    time_ns: int


class VehicleAnswer(Enum):
    """Whether a vehicle has a station, and one that is there when the drive begins within the first second,
    or at once."""

    NO_STATION = b""
    STATION = b"yes"
    STATION_AT_ONCE = b"now"


class VehicleQuestion(NamedTuple):
    """Whether a vehicle has a station, which `VehicleAnswer` tells. type, vclass: SUMO's."""

    vehicle: str
    type: str
    vclass: str


class NewStation(NamedTuple):
    """A vehicle has a station from now on, which calls itself `station_id`."""

    time_ns: int
    station_id: int
    power_dbm: float
    vehicle: str


class Transmission(NamedTuple):
    """A station hands a GeoNetworking packet to its radio. packet_id: unique in the run."""

    time_ns: int
    station_id: int
    packet_id: int
    packet: bytes


class Arrival(NamedTuple):
    """A station has received a packet."""

    time_ns: int
    station_id: int
    packet_id: int
    power_dbm: float
    sinr_db: float


class BusyRatio(NamedTuple):
    """The channel load that a station has measured."""

    time_ns: int
    station_id: int
    ratio: float


class Ended(NamedTuple):
    """A radio has sent a packet; only where advpipe says what is sent (`given_records.py`)."""

    time_ns: int
    packet_id: int


Record = (
    Hello | StepBegun | StepDone | VehicleQuestion | NewStation | Transmission | Arrival | BusyRatio | Ended
)

_TIME, _NEW, _SENT = struct.Struct("<q"), struct.Struct("<qId"), struct.Struct("<qIq")
_ARRIVAL, _LOAD, _LENGTH, _TEXT, _ENDED = (
    struct.Struct("<qIqdd"),
    struct.Struct("<qId"),
    struct.Struct("<I"),
    struct.Struct("<H"),
    struct.Struct("<qq"),
)


def parse_record(data: bytes) -> Record:
    """The record in these bytes, without their length. Raises AdvpipeError for any others."""
    try:
        parse = _KINDS[data[:1]]
        return parse(data[1:])
    except (KeyError, struct.error, UnicodeDecodeError, ValueError):
        raise AdvpipeError(
            f"Artery's module sent a record of {len(data)} bytes that advpipe cannot read; build it anew"
        ) from None


class RecordParser:
    """Splits the bytes of the socket into records, however they arrive."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[Record]:
        """Yield the records that are complete with these bytes. Raises AdvpipeError for one too long."""
        self._rest += data
        begin = 0
        while len(self._rest) - begin >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._rest, begin)
            if not 0 < length <= LONGEST_RECORD:
                raise AdvpipeError(f"Artery's module sent a record of {length} bytes; build it anew")
            end = begin + _LENGTH.size + length
            if len(self._rest) < end:
                break
            yield parse_record(bytes(self._rest[begin + _LENGTH.size : end]))
            begin = end
        del self._rest[:begin]


def _texts(data: bytes) -> list[str]:
    found = []
    while data:
        (length,) = _TEXT.unpack_from(data)
        text, data = data[_TEXT.size : _TEXT.size + length], data[_TEXT.size + length :]
        if len(text) < length:
            raise ValueError
        found.append(text.decode())
    return found


def _hello(data: bytes) -> Record:
    (version,) = _texts(data[_TEXT.size :])
    (protocol,) = _TEXT.unpack_from(data)
    return Hello(protocol, version)


def _question(data: bytes) -> Record:
    vehicle, kind, vclass = _texts(data)
    return VehicleQuestion(vehicle, kind, vclass)


def _new_station(data: bytes) -> Record:
    (vehicle,) = _texts(data[_NEW.size :])
    time_ns, station_id, power_dbm = _NEW.unpack_from(data)
    return NewStation(time_ns, station_id, power_dbm, vehicle)


def _transmission(data: bytes) -> Record:
    time_ns, station_id, packet_id = _SENT.unpack_from(data)
    return Transmission(time_ns, station_id, packet_id, data[_SENT.size :])


_KINDS: dict[bytes, Callable[[bytes], Record]] = {
    b"H": _hello,
    b"B": lambda data: StepBegun(*_TIME.unpack(data)),
    b"T": lambda data: StepDone(*_TIME.unpack(data)),
    b"A": _question,
    b"V": _new_station,
    b"S": _transmission,
    b"R": lambda data: Arrival(*_ARRIVAL.unpack(data)),
    b"L": lambda data: BusyRatio(*_LOAD.unpack(data)),
    b"E": lambda data: Ended(*_ENDED.unpack(data)),
}
