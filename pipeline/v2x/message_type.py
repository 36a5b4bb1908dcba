"""The types of messages that stations send: what the layers below and a bag need to know of each.

Sent messages do not name their type: the ITS PDU header that every message begins with does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from advpipe.pipeline.v2x.codec.btp import CAM_PORT
from advpipe.pipeline.v2x.codec.codec import CAM_CODEC
from advpipe.pipeline.v2x.codec.cpm_codec import CPM_CODEC
from advpipe.pipeline.v2x.codec.denm_codec import DENM_CODEC, DENM_PORT
from advpipe.pipeline.v2x.codec.message_codec import MessageCodec

HEADER_BYTES = 6
"""The ITS PDU header: protocol version, message id, station id (TS 102 894-2)."""


@dataclass(frozen=True)
class MessageType:
    """One type of message.

    name: in topics. codec: of its bytes. port: of BTP-B, its well-known destination (TS 103 248). psid: its
    ITS-AID (TS 102 965); permissions: what a ticket permits of it, a bit map. traffic_class: of GeoNetworking
    (TS 102 636-4-2). ros_package, ros_type: of the message in ROS 2, such as `etsi_its_cam_msgs` and `CAM`.
    """

    name: str
    codec: MessageCodec
    port: int
    psid: int
    permissions: bytes
    traffic_class: int
    ros_package: str
    ros_type: str

    @property
    def message_id(self) -> int:
        """Of the ITS PDU header."""
        return self.codec.message_id

    @property
    def ros_name(self) -> str:
        """The full name of its ROS 2 type."""
        return f"{self.ros_package}/msg/{self.ros_type}"


CAM = MessageType(
    "cam",
    CAM_CODEC,
    port=CAM_PORT,
    psid=36,
    permissions=bytes.fromhex("01 00 00"),  # version 1, none of them special (EN 302 637-2, 6.2.2.3)
    traffic_class=2,
    ros_package="etsi_its_cam_msgs",
    ros_type="CAM",
)

CPM = MessageType(
    "cpm",
    CPM_CODEC,
    port=2009,
    psid=639,
    permissions=bytes.fromhex("01"),  # version 1
    traffic_class=2,
    ros_package="etsi_its_cpm_ts_msgs",
    ros_type="CollectivePerceptionMessage",
)

DENM = MessageType(
    "denm",
    DENM_CODEC,
    port=DENM_PORT,
    psid=37,
    permissions=bytes.fromhex("01 ff ff ff"),  # version 1, every cause (EN 302 637-3, 6.2.2.3)
    traffic_class=1,
    ros_package="etsi_its_denm_msgs",
    ros_type="DENM",
)

MESSAGE_TYPES: Mapping[str, MessageType] = {each.name: each for each in (CAM, DENM, CPM)}
"""All types, by name."""

_BY_HEADER = {bytes([each.codec.protocol_version, each.message_id]): each for each in MESSAGE_TYPES.values()}
_BY_PORT = {each.port: each for each in MESSAGE_TYPES.values()}


def message_type_of(payload: bytes) -> MessageType:
    """The type of message that begins so; `CAM` for bytes that begin like none, which pose as one."""
    return _BY_HEADER.get(payload[:2], CAM)


def message_type_at(port: int) -> MessageType | None:
    """The type of message for a port of BTP; None for another one."""
    return _BY_PORT.get(port)


def is_cam(payload: bytes) -> bool:
    """Whether a message is a CAM, or bytes that pose as one."""
    return _BY_HEADER.get(payload[:2], CAM) is CAM


def claimed_station_id(payload: bytes) -> int | None:
    """The station id in the header of a message, true or not; None for too few bytes."""
    return int.from_bytes(payload[2:HEADER_BYTES], "big") if len(payload) >= HEADER_BYTES else None
