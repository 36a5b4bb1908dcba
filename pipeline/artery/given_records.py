"""What our module in Artery is told where advpipe says what is sent: records as those of `records.py`.

The module is `module/GivenStations.cc`, which has the same `PROTOCOL`. Times are in nanoseconds from the
start of Artery's simulation, places in metres in the map's frame. A step is one block: where the stations
are, who has left, what is sent when, and until when to simulate.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

PROTOCOL = 1

_LENGTH, _PLACE, _LEFT = struct.Struct("<I"), struct.Struct("<cIddd"), struct.Struct("<cI")
_MESSAGE, _UNTIL = struct.Struct("<cqIqd"), struct.Struct("<cq")


def place(station_id: int, x_m: float, y_m: float, z_m: float) -> bytes:
    """The antenna of a station, which is new or has moved, is there."""
    return _PLACE.pack(b"P", station_id, x_m, y_m, z_m)


def left(station_id: int) -> bytes:
    """A station has left; what waits in its radio is lost."""
    return _LEFT.pack(b"Q", station_id)


def message(time_ns: int, station_id: int, number: int, power_dbm: float, packet: bytes) -> bytes:
    """A station hands a packet to its radio, which sends it with this power."""
    return _MESSAGE.pack(b"M", time_ns, station_id, number, power_dbm) + packet


def until(time_ns: int) -> bytes:
    """The last record of a step: simulate up to this time."""
    return _UNTIL.pack(b"U", time_ns)


def block(records: Iterable[bytes]) -> bytes:
    """The records with their lengths, as they go over the socket."""
    return b"".join(_LENGTH.pack(len(record)) + record for record in records)
