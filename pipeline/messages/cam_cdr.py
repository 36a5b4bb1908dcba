"""Serialises the ASN.1 values of a message as etsi_its_cam_msgs/CAM or a sibling, without message objects.

For each type, one writing function is made once. A part that a CAM omits is always written as the same bytes,
apart from their alignment.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

from advpipe.pipeline.messages.cam_types import CamType, Member, asn1_types
from advpipe.pipeline.messages.cdr import Cdr
from advpipe.pipeline.v2x.codec.message_codec import MessageTree
from advpipe.pipeline.v2x.message_type import CAM, MessageType

Write = Callable[[Any, Cdr], None]

_FORMATS = {"int8": "b", "int16": "h", "int32": "i", "int64": "q"}
_FORMATS |= {f"u{name}": code.upper() for name, code in _FORMATS.items()}
_ALIGNMENTS = 8


def cam_cdr(tree: MessageTree) -> bytes:
    """The serialised CAM. Raises CamError for values of a later release, which it cannot hold."""
    return message_cdr(CAM, tree)


def message_cdr(message: MessageType, tree: MessageTree) -> bytes:
    """The serialised message. Raises the codec's error for values of a later release."""
    cdr = Cdr()
    try:
        _writer(message.ros_package, message.ros_type)(tree, cdr)
    except (KeyError, struct.error, OverflowError) as error:
        where = f"{message.ros_package}/{message.ros_type}"
        raise message.codec.error(
            f"{where} cannot hold a value of this {message.codec.name}: {error}"
        ) from None
    return bytes(cdr)


@cache
def _writer(package: str, name: str) -> Write:
    cam_type = asn1_types(package)[name]
    return _WRITERS[cam_type.kind](cam_type)


def _basic(number: str) -> Write:
    if number == "string":
        return lambda value, cdr: cdr.string(value)
    return _boolean() if number == "bool" else _number(number)


def _number(number: str) -> Write:
    layout = struct.Struct(f"<{_FORMATS[number]}")
    pack, size = layout.pack, layout.size

    def write(value: int, cdr: Cdr) -> None:
        cdr.align(size)
        cdr.body += pack(value)

    return write


def _integer(cam_type: CamType) -> Write:
    return _number(cam_type.number)


def _enumerated(cam_type: CamType) -> Write:
    number = _number(cam_type.number)
    index_of = {name: index for index, name in enumerate(cam_type.names)}

    def write(value: str, cdr: Cdr) -> None:
        number(index_of[value], cdr)

    return write


def _boolean(_: CamType | None = None) -> Write:
    return lambda value, cdr: cdr.uint8(bool(value))


def _bit_string(_: CamType) -> Write:
    def write(value: tuple[int, int], cdr: Cdr) -> None:
        bits, length = value
        unused = -length % 8
        cdr.octets((bits << unused).to_bytes((length + unused) // 8, "big"))
        cdr.uint8(unused)

    return write


def _octet_string(_: CamType) -> Write:
    return lambda value, cdr: cdr.octets(value)


def _string(_: CamType) -> Write:
    return _basic("string")


def _alias(cam_type: CamType) -> Write:
    return _writer(cam_type.package, cam_type.element)


def _sequence_of(cam_type: CamType) -> Write:
    item = _writer(cam_type.package, cam_type.element)

    def write(values: list[Any], cdr: Cdr) -> None:
        cdr.uint32(len(values))
        for value in values:
            item(value, cdr)

    return write


def _sequence(cam_type: CamType) -> Write:
    members = [
        (member.asn1_name, member.optional, _part(member), _absent(member)) for member in cam_type.members
    ]

    def write(value: dict[str, Any], cdr: Cdr) -> None:
        for name, optional, part, absent in members:
            if optional:
                is_present = name in value
                if is_present:
                    part(value[name], cdr)
                else:
                    absent(cdr)
                cdr.uint8(is_present)
            else:
                part(value[name], cdr)

    return write


def _choice(cam_type: CamType) -> Write:
    index_of = {member.asn1_name: index for index, member in enumerate(cam_type.members)}
    members = [(member.asn1_name, _part(member), _absent(member)) for member in cam_type.members]

    def write(value: tuple[str, Any], cdr: Cdr) -> None:
        chosen, content = value
        cdr.uint8(index_of[chosen])
        for name, part, absent in members:
            if name == chosen:
                part(content, cdr)
            else:
                absent(cdr)

    return write


def _part(member: Member) -> Write:
    return _writer(member.package, member.type) if member.type else _basic(member.number)


def _absent(member: Member) -> Callable[[Cdr], None]:
    """A function that writes the bytes of an omitted part: zeros and empty sequences."""
    by_alignment: list[bytes] = []
    for offset in range(_ALIGNMENTS):
        cdr = Cdr()
        cdr.body += bytes(offset)
        _part(member)(_empty_part(member), cdr)
        by_alignment.append(bytes(cdr.body[offset:]))

    def write(cdr: Cdr) -> None:
        cdr.body += by_alignment[len(cdr.body) % _ALIGNMENTS]

    return write


def _empty_part(member: Member) -> Any:
    if member.type:
        return _empty(member.package, member.type)
    return "" if member.number == "string" else 0


@cache
def _empty(package: str, name: str) -> Any:
    """The value of a new ROS 2 message: zeros; a CHOICE takes its first alternative."""
    cam_type = asn1_types(package)[name]
    match cam_type.kind:
        case "SEQUENCE":
            return {
                member.asn1_name: _empty_part(member) for member in cam_type.members if not member.optional
            }
        case "CHOICE":
            first = cam_type.members[0]
            return first.asn1_name, _empty_part(first)
        case "SEQUENCE OF":
            return []
        case "alias":
            return _empty(package, cam_type.element)
        case "ENUMERATED":
            return cam_type.names[0]
        case "BIT STRING":
            return 0, 0
        case "OCTET STRING":
            return b""
        case "IA5String" | "NumericString" | "UTF8String":
            return ""
    return 0


_WRITERS: dict[str, Callable[[CamType], Write]] = {
    "INTEGER": _integer,
    "ENUMERATED": _enumerated,
    "BOOLEAN": _boolean,
    "BIT STRING": _bit_string,
    "OCTET STRING": _octet_string,
    "IA5String": _string,
    "NumericString": _string,
    "UTF8String": _string,
    "alias": _alias,
    "SEQUENCE OF": _sequence_of,
    "SEQUENCE": _sequence,
    "CHOICE": _choice,
}
