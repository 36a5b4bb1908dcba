"""Writes messages in CDR (Common Data Representation) field by field, which is faster than rosbags' objects.

The bytes are the same as those of `types.serialise` for the same values, which the tests check.
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
    """A writer of one message; call its methods in the order of the message's fields.

    A number is aligned to its own size, counted from the end of the encapsulation header. Raises struct.error
    (or ValueError for a uint8) for a number out of range.
    """

    __slots__ = ("body",)

    def __init__(self) -> None:
        self.body = bytearray()

    def __bytes__(self) -> bytes:
        return _ENCAPSULATION + self.body

    def align(self, size: int) -> None:
        """Pad to a multiple of `size` bytes."""
        self.body += _PADDING[-len(self.body) % size]

    def uint8(self, value: int) -> None:
        """One uint8 or bool."""
        self.body.append(value)

    def uint16(self, value: int) -> None:
        """One uint16."""
        self.align(2)
        self.body += _UINT16.pack(value)

    def uint32(self, *values: int) -> None:
        """One or several consecutive uint32."""
        self.align(4)
        for value in values:
            self.body += _UINT32.pack(value)

    def uint64(self, value: int) -> None:
        """One uint64."""
        self.align(8)
        self.body += _UINT64.pack(value)

    def float32(self, *values: float) -> None:
        """One or several consecutive float32."""
        self.align(4)
        self.body += struct.pack(f"<{len(values)}f", *values)

    def float64(self, *values: float) -> None:
        """One or several consecutive float64."""
        self.align(8)
        self.body += struct.pack(f"<{len(values)}d", *values)

    def string(self, text: str) -> None:
        """A string: its length, its bytes in UTF-8, and a terminating zero."""
        data = text.encode()
        self.uint32(len(data) + 1)
        self.body += data
        self.body.append(0)

    def octets(self, data: bytes) -> None:
        """A sequence of uint8."""
        self.uint32(len(data))
        self.body += data

    def time(self, stamp_ns: int) -> None:
        """builtin_interfaces/Time from a stamp in nanoseconds."""
        self.align(4)
        self.body += _TIME.pack(*divmod(stamp_ns, _NS_PER_S))

    def header(self, stamp_ns: int, frame_id: str) -> None:
        """std_msgs/Header."""
        self.time(stamp_ns)
        self.string(frame_id)


def stamp_of_header(cdr: bytes) -> int:
    """The stamp in nanoseconds of a serialised message that begins with a std_msgs/Header."""
    seconds, nanoseconds = _TIME.unpack_from(cdr, len(_ENCAPSULATION))
    return int(seconds) * _NS_PER_S + int(nanoseconds)
