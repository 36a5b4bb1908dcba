"""Common Data Representation: messages written field by field, where rosbags' objects would take too long.

The bytes are those that `types.serialise` makes of the same values; the tests compare them.
"""

from __future__ import annotations

import struct

_ENCAPSULATION = b"\x00\x01\x00\x00"  # little endian, XCDR1
_PADDING = tuple(bytes(length) for length in range(8))
_NS_PER_S = 1_000_000_000
_TIME = struct.Struct("<iI")
_UINT16 = struct.Struct("<H")
_UINT32 = struct.Struct("<I")
_UINT64 = struct.Struct("<Q")


class Cdr:
    """One message in the making: call the methods in the order of its fields.

    A number is aligned to its own size, counted from the end of the encapsulation, which comes first.
    """

    __slots__ = ("body",)

    def __init__(self) -> None:
        self.body = bytearray()

    def __bytes__(self) -> bytes:
        return _ENCAPSULATION + self.body

    def align(self, size: int) -> None:
        self.body += _PADDING[-len(self.body) % size]

    def uint8(self, value: int) -> None:
        self.body.append(value)

    def uint16(self, value: int) -> None:
        self.align(2)
        self.body += _UINT16.pack(value)

    def uint32(self, *values: int) -> None:
        self.align(4)
        for value in values:
            self.body += _UINT32.pack(value)

    def uint64(self, value: int) -> None:
        self.align(8)
        self.body += _UINT64.pack(value)

    def float32(self, *values: float) -> None:
        self.align(4)
        self.body += struct.pack(f"<{len(values)}f", *values)

    def float64(self, *values: float) -> None:
        self.align(8)
        self.body += struct.pack(f"<{len(values)}d", *values)

    def string(self, text: str) -> None:
        """Its length, its bytes, and the zero that ends it."""
        data = text.encode()
        self.uint32(len(data) + 1)
        self.body += data
        self.body.append(0)

    def octets(self, data: bytes) -> None:
        """A sequence of uint8."""
        self.uint32(len(data))
        self.body += data

    def time(self, stamp_ns: int) -> None:
        """builtin_interfaces/Time."""
        self.align(4)
        self.body += _TIME.pack(*divmod(stamp_ns, _NS_PER_S))

    def header(self, stamp_ns: int, frame_id: str) -> None:
        """std_msgs/Header."""
        self.time(stamp_ns)
        self.string(frame_id)
