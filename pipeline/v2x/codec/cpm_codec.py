"""Encoding and decoding of collective perception messages (CPMs, ETSI TS 103 324 v2.1.1) in unaligned PER.

`cpm.asn` has the message's ASN.1, and `cpm_asn1.py` what pycrate compiles of it (`cpm_compile.py`). Each
container is encoded by itself, as an open type; in the values here it is a tree as all others are.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.codec.message_codec import MessageCodec, MessageTree
from advpipe.pipeline.v2x.codec.uper import Uper

MESSAGE_ID_CPM = 14
PROTOCOL_VERSION_CPM = 2

VEHICLE, ROADSIDE, SENSORS, REGIONS, OBJECTS = 1, 2, 3, 4, 5
CONTAINERS = {
    VEHICLE: "OriginatingVehicleContainer",
    ROADSIDE: "OriginatingRsuContainer",
    SENSORS: "SensorInformationContainer",
    REGIONS: "PerceptionRegionContainer",
    OBJECTS: "PerceivedObjectContainer",
}
"""The ASN.1 types of containers by `containerId`."""


class CpmError(MessageError):
    """The bytes are not a valid CPM, or the values cannot be encoded as one."""


@dataclass(frozen=True)
class CpmCodec(MessageCodec):
    """`MessageCodec` with the containers opened: `containerData` has a container's values, or the bytes of a
    container of a later release."""

    def encode(self, tree: MessageTree) -> bytes:
        return super().encode(_with_containers(tree, _closed))

    def decode(self, payload: bytes) -> MessageTree:
        return _with_containers(super().decode(payload), _opened)


def asn1_part(name: str) -> Any:
    """pycrate's object for an ASN.1 type of the CPM."""
    from advpipe.pipeline.v2x.codec import cpm_asn1  # 0.05 s

    return getattr(cpm_asn1.AdvpipeCollectivePerception, name)


def _asn1() -> Any:
    return asn1_part("CollectivePerceptionMessage")


CPM_CODEC = CpmCodec("CPM", _asn1, PROTOCOL_VERSION_CPM, MESSAGE_ID_CPM, CpmError)


@cache
def _container(number: int) -> Uper:
    return Uper(asn1_part(CONTAINERS[number]))


def _closed(number: int, data: Any) -> bytes:
    if isinstance(data, bytes):
        return data
    with suppress(Exception):
        return _container(number).encode(data)
    name = CONTAINERS.get(number, f"container {number}")
    raise CpmError(f"cannot encode these values as the {name} of a CPM")


def _opened(number: int, data: bytes) -> Any:
    """Raises CpmError for bytes that are not the container, or one with extensions of later releases."""
    if number not in CONTAINERS:
        return data
    with suppress(Exception):
        return _container(number).decode(data)
    raise CpmError(f"{len(data)} bytes are not the {CONTAINERS[number]} of a CPM")


def _with_containers(tree: MessageTree, change: Callable[[int, Any], Any]) -> MessageTree:
    payload = tree["payload"]
    containers = [
        {"containerId": each["containerId"], "containerData": change(each["containerId"], each["containerData"])}
        for each in payload["cpmContainers"]
    ]
    return {**tree, "payload": {**payload, "cpmContainers": containers}}
