"""Reads the ASN.1 values of a serialised etsi_its_cam_msgs/CAM, as `cam_cdr` writes them."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

from advpipe.pipeline.messages.cam_types import CamType, Member, cam_types
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import CamTree

_LITTLE_ENDIAN = b"\0\1"
_HEADER_BYTES = 4
_FORMATS = {"int8": "b", "int16": "h", "int32": "i", "int64": "q"}
_FORMATS |= {f"u{name}": code.upper() for name, code in _FORMATS.items()}


def cam_tree_of_cdr(cdr: bytes) -> CamTree:
    """The values of a CAM. Raises CamError for bytes that are not such a message, or not whole."""
    if cdr[:2] != _LITTLE_ENDIAN:
        raise CamError("no etsi_its_cam_msgs/CAM in little-endian CDR")
    cursor = _Cursor(cdr[_HEADER_BYTES:])
    try:
        tree: CamTree = _reader("CAM")(cursor)
    except (struct.error, IndexError) as error:
        raise CamError(f"no whole etsi_its_cam_msgs/CAM: {error}") from None
    return tree


class _Cursor:
    """The body of a message; alignment is counted from its beginning."""

    __slots__ = ("body", "place")

    def __init__(self, body: bytes) -> None:
        self.body, self.place = body, 0

    def number(self, layout: struct.Struct) -> int:
        self.place += -self.place % layout.size
        (value,) = layout.unpack_from(self.body, self.place)
        self.place += layout.size
        return int(value)

    def octets(self) -> bytes:
        length = self.length()
        found = self.body[self.place : self.place + length]
        self.place += length
        return found

    def length(self) -> int:
        """The length of a sequence, none of whose items is smaller than a byte."""
        length = self.number(_UINT32)
        if length > len(self.body) - self.place:
            raise IndexError("a sequence extends past the end")
        return length


_UINT8, _UINT32 = struct.Struct("<B"), struct.Struct("<I")

Read = Callable[[_Cursor], Any]


@cache
def _reader(name: str) -> Read:
    cam_type = cam_types()[name]
    return _READERS[cam_type.kind](cam_type)


def _number(number: str) -> Read:
    layout = struct.Struct(f"<{_FORMATS[number]}")
    return lambda cursor: cursor.number(layout)


def _integer(cam_type: CamType) -> Read:
    return _number(cam_type.number)


def _enumerated(cam_type: CamType) -> Read:
    number = _number(cam_type.number)
    return lambda cursor: cam_type.names[number(cursor)]


def _boolean(_: CamType) -> Read:
    return lambda cursor: bool(cursor.number(_UINT8))


def _bit_string(_: CamType) -> Read:
    def read(cursor: _Cursor) -> tuple[int, int]:
        data = cursor.octets()
        unused = cursor.number(_UINT8)
        length = 8 * len(data) - unused
        if unused > 7 or length < 0:
            raise IndexError("a bit string has more unused bits than it holds")
        return int.from_bytes(data, "big") >> unused, length

    return read


def _octet_string(_: CamType) -> Read:
    return _Cursor.octets


def _alias(cam_type: CamType) -> Read:
    return _reader(cam_type.element)


def _sequence_of(cam_type: CamType) -> Read:
    item = _reader(cam_type.element)
    return lambda cursor: [item(cursor) for _ in range(cursor.length())]


def _sequence(cam_type: CamType) -> Read:
    members = [(member.asn1_name, member.optional, _part(member)) for member in cam_type.members]

    def read(cursor: _Cursor) -> dict[str, Any]:
        found = {}
        for name, optional, part in members:
            value = part(cursor)
            if not optional or cursor.number(_UINT8):
                found[name] = value
        return found

    return read


def _choice(cam_type: CamType) -> Read:
    members = [(member.asn1_name, _part(member)) for member in cam_type.members]

    def read(cursor: _Cursor) -> tuple[str, Any]:
        chosen = cursor.number(_UINT8)
        values = [(name, part(cursor)) for name, part in members]
        return values[chosen]

    return read


def _part(member: Member) -> Read:
    return _reader(member.type) if member.type else _number(member.number)


_READERS: dict[str, Callable[[CamType], Read]] = {
    "INTEGER": _integer,
    "ENUMERATED": _enumerated,
    "BOOLEAN": _boolean,
    "BIT STRING": _bit_string,
    "OCTET STRING": _octet_string,
    "alias": _alias,
    "SEQUENCE OF": _sequence_of,
    "SEQUENCE": _sequence,
    "CHOICE": _choice,
}
