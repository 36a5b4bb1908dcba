"""Encoding and decoding of collective perception messages (CPMs, ETSI TS 103 324 v2.1.1) in unaligned PER.

`cpm.asn` has the message's ASN.1, which pycrate compiles (`cpm_asn1.py`). Each container is encoded by
itself, as an open type; in the values here it is a tree as all others are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.codec.cpm_asn1 import cpm_types
from advpipe.pipeline.v2x.codec.message_codec import (
    PYCRATE_LOCK,
    MessageCodec,
    MessageTree,
    without_additions,
)
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

    @property
    def open_types(self) -> Mapping[str, Mapping[int, tuple[str, Any]]]:
        return {"WrappedCpmContainer": {each: (name, asn1_part(name)) for each, name in CONTAINERS.items()}}

    def encode(self, tree: MessageTree) -> bytes:
        return super().encode(_with_containers(tree, _closed))

    def decode(self, payload: bytes) -> MessageTree:
        return _with_containers(super().decode(payload), _opened)


def asn1_part(name: str) -> Any:
    """pycrate's object for an ASN.1 type of the CPM."""
    return getattr(cpm_types(), name)


def _asn1() -> Any:
    return asn1_part("CollectivePerceptionMessage")


CPM_CODEC = CpmCodec("CPM", _asn1, PROTOCOL_VERSION_CPM, MESSAGE_ID_CPM, CpmError, "messageId")


@cache
def _container(number: int) -> Uper:
    return Uper(asn1_part(CONTAINERS[number]))


def _closed(number: int, data: Any) -> bytes:
    if isinstance(data, bytes):
        return data
    if number not in CONTAINERS:
        raise CpmError(f"a CPM of this release has no container {number}")
    with suppress(Exception):
        return _container(number).encode(data)
    with PYCRATE_LOCK:
        try:
            return bytes(asn1_part(CONTAINERS[number]).to_uper(data))
        except Exception as error:  # pycrate raises several classes, and some by accident
            raise CpmError(f"cannot encode these values as {CONTAINERS[number]}: {error}") from None


def _opened(number: int, data: bytes) -> Any:
    """Extensions of later releases are skipped. Raises CpmError for bytes that are not the container."""
    if number not in CONTAINERS:
        return data
    with suppress(Exception):
        return _container(number).decode(data)
    asn1 = asn1_part(CONTAINERS[number])
    with PYCRATE_LOCK:
        try:
            asn1.from_uper(data)
            return without_additions(asn1.get_val())
        except Exception as error:
            raise CpmError(f"{len(data)} bytes are not the {CONTAINERS[number]} of a CPM: {error}") from None


def _with_containers(tree: MessageTree, change: Callable[[int, Any], Any]) -> MessageTree:
    payload = tree["payload"]
    containers = [
        {
            "containerId": (number := each["containerId"]),
            "containerData": change(number, each["containerData"]),
        }
        for each in payload["cpmContainers"]
    ]
    return {**tree, "payload": {**payload, "cpmContainers": containers}}
