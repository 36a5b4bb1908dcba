"""The long position vector of GeoNetworking: who sent a packet, from where (ETSI EN 302 636-4-1, 9.5.2)."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from advpipe.pipeline.v2x.codec.timestamps import generation_time_ns, timestamp_its_ms
from advpipe.pipeline.v2x.facilities.cam import Cam, CamCore

VECTOR_BYTES = 24
MAX_SPEED_CMPS = 2**14 - 1
_LAYOUT = struct.Struct(">H6sIiiHH")
_MILLISECONDS = 2**32


@dataclass(frozen=True, slots=True)
class LongPositionVector:
    """mac: six bytes. time_ms: TimestampIts modulo 2^32. latitude, longitude: in 1e-7 degrees. speed_cmps:
    cm/s, negative backwards. heading_ddeg: tenths of a degree clockwise from north."""

    station_type: int
    mac: bytes
    time_ms: int
    latitude: int = 0
    longitude: int = 0
    is_accurate: bool = False
    speed_cmps: int = 0
    heading_ddeg: int = 0

    def encode(self) -> bytes:
        """The 24 bytes of the vector."""
        speed = (self.is_accurate << 15) | (self.speed_cmps & 0x7FFF)
        return _LAYOUT.pack(
            (self.station_type & 0x1F) << 10,
            self.mac,
            self.time_ms,
            self.latitude,
            self.longitude,
            speed,
            self.heading_ddeg,
        )

    @classmethod
    def decode(cls, data: bytes) -> LongPositionVector:
        """The vector in 24 bytes."""
        address, mac, time_ms, latitude, longitude, speed, heading_ddeg = _LAYOUT.unpack(data)
        station_type = (address >> 10) & 0x1F
        is_accurate, speed_cmps = bool(speed >> 15), (speed & 0x7FFF) - ((speed & 0x4000) << 1)
        return cls(station_type, mac, time_ms, latitude, longitude, is_accurate, speed_cmps, heading_ddeg)


def position_vector(cam: Cam | CamCore | None, mac: bytes, now_ns: int) -> LongPositionVector:
    """The vector of a station whose CAM says this; without one (None), a vector without a position.

    A position that a CAM does not state, or states out of range, is 0, and so is a speed or heading.
    """
    if cam is None:
        return LongPositionVector(0, mac, timestamp_its_ms(now_ns) % _MILLISECONDS)
    time_ns = generation_time_ns(cam.generation_delta_time_ms, now_ns)
    latitude_deg, longitude_deg = _finite(cam.latitude_deg), _finite(cam.longitude_deg)
    speed_cmps = round(100 * _finite(cam.speed_mps))
    return LongPositionVector(
        cam.station_type,
        mac,
        timestamp_its_ms(time_ns) % _MILLISECONDS,
        round(latitude_deg * 1e7),
        round(longitude_deg * 1e7),
        cam.latitude_deg is not None and cam.longitude_deg is not None,
        min(speed_cmps, MAX_SPEED_CMPS),
        round(math.degrees(_finite(cam.heading_rad)) * 10) % 3600,
    )


def _finite(value: float | None) -> float:
    return value if value is not None and math.isfinite(value) else 0.0
