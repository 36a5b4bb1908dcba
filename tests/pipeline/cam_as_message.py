"""CAMs as messages, value by value through rosbags: what `cam_cdr.py` writes faster must be the same.

Decoded (etsi_its_cam_msgs/CAM) and raw (udp_msgs/UdpPacket with its BTP-B header).
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cam_types import CamType, Member, cam_types, full_name
from advpipe.pipeline.messages.types import message_class
from advpipe.pipeline.v2x.codec.btp import btp_packet
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import CamTree

UDP_TYPE = "udp_msgs/msg/UdpPacket"


def udp_packet(stamp_ns: int, payload: bytes, *, frame_id: str = "", address: str = "") -> Any:
    """udp_msgs/UdpPacket of a CAM in UPER, for the etsi_its_conversion node's defaults.

    Its data: destination port 2001 and port info (BTP-B, big endian, 4 bytes), then the CAM.
    """
    return message_class(UDP_TYPE)(
        header=build.message_header(stamp_ns, frame_id),
        address=address,
        src_port=0,
        data=np.frombuffer(btp_packet(payload), np.uint8),
    )


def cam_message(tree: CamTree) -> Any:
    """etsi_its_cam_msgs/CAM of a CAM's ASN.1 values; what is absent holds zeros.

    Raises CamError for values that the message cannot hold: those that a later release has added.
    """
    try:
        return _message("CAM", tree)
    except ValueError as error:
        raise CamError(f"etsi_its_cam_msgs/CAM cannot hold a value of this CAM: {error}") from None


def cam_of_message(message: Any) -> CamTree:
    """The ASN.1 values of an etsi_its_cam_msgs/CAM. Raises CamError for a choice or enumeration unknown."""
    tree: CamTree = _value("CAM", message)
    return tree


def _message(name: str, value: Any) -> Any:
    cam_type, make = _type(name)
    match cam_type.kind:
        case "SEQUENCE":
            fields = dict(_absent(name))
            for member in cam_type.members:
                if member.asn1_name in value:
                    part = value[member.asn1_name]
                    fields[member.field] = _message(member.type, part) if member.type else part
                    if member.optional:
                        fields[f"{member.field}_is_present"] = True
            return make(**fields)
        case "CHOICE":
            place = [member.asn1_name for member in cam_type.members].index(value[0])
            chosen = cam_type.members[place]
            return make(**{**_absent(name), "choice": place, chosen.field: _message(chosen.type, value[1])})
        case "SEQUENCE OF":
            return make(array=[_message(cam_type.element, item) for item in value])
        case "alias":
            return make(value=_message(cam_type.element, value))
        case "ENUMERATED":
            return make(value=cam_type.names.index(value))
        case "INTEGER":
            if not value <= cam_type.highest:
                raise ValueError(f"{name} {value}")
            return make(value=value)
        case "BIT STRING":
            bits, length = value
            unused = -length % 8
            packed = (bits << unused).to_bytes((length + unused) // 8, "big")
            return make(value=np.frombuffer(packed, np.uint8), bits_unused=unused)
        case "OCTET STRING":
            return make(value=np.frombuffer(value, np.uint8))
    return make(value=value)


def _value(name: str, message: Any) -> Any:
    cam_type, _ = _type(name)
    match cam_type.kind:
        case "SEQUENCE":
            return {
                member.asn1_name: _part(member, message)
                for member in cam_type.members
                if not member.optional or getattr(message, f"{member.field}_is_present")
            }
        case "CHOICE":
            if message.choice >= len(cam_type.members):
                raise CamError(f"{name} has no alternative {message.choice}")
            chosen = cam_type.members[message.choice]
            return chosen.asn1_name, _part(chosen, message)
        case "SEQUENCE OF":
            return [_value(cam_type.element, item) for item in message.array]
        case "alias":
            return _value(cam_type.element, message.value)
        case "ENUMERATED":
            if message.value >= len(cam_type.names):
                raise CamError(f"{name} has no value {message.value}")
            return cam_type.names[message.value]
        case "BIT STRING":
            packed = bytes(message.value)
            return int.from_bytes(packed, "big") >> message.bits_unused, 8 * len(packed) - message.bits_unused
        case "OCTET STRING":
            return bytes(message.value)
        case "BOOLEAN":
            return bool(message.value)
    return int(message.value)


def _part(member: Member, message: Any) -> Any:
    part = getattr(message, member.field)
    return _value(member.type, part) if member.type else int(part)


@cache
def _type(name: str) -> tuple[CamType, Any]:
    return cam_types()[name], message_class(full_name(name))


@cache
def _absent(name: str) -> dict[str, Any]:
    """The fields of a SEQUENCE or CHOICE before any is set; shared between messages, so never changed."""
    cam_type, _ = _type(name)
    fields: dict[str, Any] = {"choice": 0} if cam_type.kind == "CHOICE" else {}
    for member in cam_type.members:
        fields[member.field] = _empty(member.type) if member.type else 0
        if member.optional:
            fields[f"{member.field}_is_present"] = False
    return fields


@cache
def _empty(name: str) -> Any:
    """The message of a type as ROS 2 makes it: zeros and empty arrays."""
    cam_type, make = _type(name)
    match cam_type.kind:
        case "SEQUENCE" | "CHOICE":
            return make(**_absent(name))
        case "SEQUENCE OF":
            return make(array=[])
        case "alias":
            return make(value=_empty(cam_type.element))
        case "BIT STRING":
            return make(value=np.zeros(0, np.uint8), bits_unused=0)
        case "OCTET STRING":
            return make(value=np.zeros(0, np.uint8))
        case "BOOLEAN":
            return make(value=False)
    return make(value=0)
