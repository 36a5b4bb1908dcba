"""A Decentralized Environmental Notification Message (EN 302 637-3 v1.3.1) in SI units, and its coding."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, NamedTuple

from advpipe.pipeline.v2x.codec import quantities as q
from advpipe.pipeline.v2x.codec.denm_codec import DENM_CODEC
from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms, unix_ns
from advpipe.pipeline.v2x.facilities.cam import PathPoint
from advpipe.pipeline.v2x.facilities.cam_tree import path_point_tree

RELEVANCE_M = 500.0
"""Radius of the area in which a DENM is relevant, and to which it is broadcast."""
_INFORMATION_QUALITY = 1
"""The lowest class that is not "unavailable"."""
MAX_TRACE_POINTS = 40


class EventKind(Enum):
    """What a DENM warns of: cause and sub-cause (TS 102 894-2)."""

    STOPPED = (94, 0)
    """stationaryVehicle."""
    COLLISION = (97, 1)
    """collisionRisk: longitudinalCollisionRisk."""
    BRAKING = (99, 1)
    """dangerousSituation: emergencyElectronicBrakeEngaged."""


class Termination(Enum):
    """How an event ends: by the station that announced it, or by another one."""

    CANCELLATION = "isCancellation"
    NEGATION = "isNegation"


class ActionId(NamedTuple):
    """The identifier of an event: the station that announced it, and a number of its own."""

    station_id: int
    number: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Denm:
    """A DENM; times in UTC since 1970, with the precision of a millisecond.

    station_id: of the sender. action: of the event. detection_ns, reference_ns: when this state of the event,
    or its end, was detected, and when it was generated (annex B.10, B.11). validity_s: after detection_ns.
    The event's position is in WGS 84, None where unavailable; heading_rad clockwise from north. kind: None
    for another cause, and for a termination without one. traces: the path to the event.
    """

    station_id: int
    action: ActionId
    detection_ns: int
    reference_ns: int
    station_type: int
    latitude_deg: float | None
    longitude_deg: float | None
    altitude_m: float | None = None
    validity_s: int = 600
    interval_s: float | None = None
    termination: Termination | None = None
    kind: EventKind | None = None
    speed_mps: float | None = None
    heading_rad: float | None = None
    traces: tuple[PathPoint, ...] = ()

    def terminated(self, by: int, now_ns: int) -> Denm:
        """The DENM by which a station ends this event: its own it cancels, another one's it negates.

        The negation refers to the state of the event that it ends (EN 302 637-3, 6.1.2).
        """
        is_own = by == self.action.station_id
        return replace(
            self,
            station_id=by,
            detection_ns=now_ns,
            reference_ns=now_ns if is_own else self.reference_ns,
            termination=Termination.CANCELLATION if is_own else Termination.NEGATION,
            kind=None,
            traces=(),
        )


def encode_denm(denm: Denm) -> bytes:
    """Encode a DENM in UPER. Raises MessageError for a value that a DENM cannot represent."""
    return DENM_CODEC.encode(denm_tree(denm))


def decode_denm(payload: bytes) -> Denm:
    """Decode a DENM in UPER. Raises DenmError for bytes that are not one."""
    return denm_of_tree(DENM_CODEC.decode(payload))


def denm_tree(denm: Denm) -> dict[str, Any]:
    """The ASN.1 values of a DENM. Raises MessageError for a value that it cannot represent."""
    management: dict[str, Any] = {
        "actionID": {
            "originatingStationID": denm.action.station_id,
            "sequenceNumber": denm.action.number,
        },
        "detectionTime": timestamp_its_ms(denm.detection_ns),
        "referenceTime": timestamp_its_ms(denm.reference_ns),
        "eventPosition": _position_tree(denm),
        "relevanceDistance": "lessThan500m",
        "relevanceTrafficDirection": "allTrafficDirections",
        "validityDuration": denm.validity_s,
        "stationType": denm.station_type,
    }
    if denm.termination is not None:
        management["termination"] = denm.termination.value
    if denm.interval_s is not None:
        management["transmissionInterval"] = round(denm.interval_s * 1000)
    body: dict[str, Any] = {"management": management}
    if denm.kind is not None:
        cause, sub_cause = denm.kind.value
        body["situation"] = {
            "informationQuality": _INFORMATION_QUALITY,
            "eventType": {"causeCode": cause, "subCauseCode": sub_cause},
        }
        body["location"] = {
            "eventSpeed": {"speedValue": q.SPEED.code(denm.speed_mps), "speedConfidence": 127},
            "eventPositionHeading": {
                "headingValue": q.HEADING.code(denm.heading_rad),
                "headingConfidence": 127,
            },
            "traces": [[path_point_tree(point) for point in denm.traces[:MAX_TRACE_POINTS]]],
        }
    header = {
        "protocolVersion": DENM_CODEC.protocol_version,
        "messageID": DENM_CODEC.message_id,
        "stationID": denm.station_id,
    }
    return {"header": header, "denm": body}


def denm_of_tree(tree: dict[str, Any]) -> Denm:
    """The DENM of ASN.1 values; its traces, confidences and containers a la carte are left out."""
    body = tree["denm"]
    management, situation, location = body["management"], body.get("situation"), body.get("location", {})
    position = management["eventPosition"]
    cause = None if situation is None else situation["eventType"]
    codes = None if cause is None else (cause["causeCode"], cause["subCauseCode"])
    speed, heading = location.get("eventSpeed"), location.get("eventPositionHeading")
    interval_ms, termination = management.get("transmissionInterval"), management.get("termination")
    return Denm(
        station_id=tree["header"]["stationID"],
        action=ActionId(*management["actionID"].values()),
        detection_ns=unix_ns(management["detectionTime"]),
        reference_ns=unix_ns(management["referenceTime"]),
        station_type=management["stationType"],
        latitude_deg=q.LATITUDE.value(position["latitude"]),
        longitude_deg=q.LONGITUDE.value(position["longitude"]),
        altitude_m=q.ALTITUDE.value(position["altitude"]["altitudeValue"]),
        validity_s=management["validityDuration"],
        interval_s=None if interval_ms is None else interval_ms / 1000,
        termination=None if termination is None else Termination(termination),
        kind=next((kind for kind in EventKind if kind.value == codes), None),
        speed_mps=None if speed is None else q.SPEED.value(speed["speedValue"]),
        heading_rad=None if heading is None else q.HEADING.value(heading["headingValue"]),
    )


def _position_tree(denm: Denm) -> dict[str, Any]:
    return {
        "latitude": q.LATITUDE.code(denm.latitude_deg),
        "longitude": q.LONGITUDE.code(denm.longitude_deg),
        "positionConfidenceEllipse": {
            "semiMajorConfidence": q.SEMI_AXIS.code(None),
            "semiMinorConfidence": q.SEMI_AXIS.code(None),
            "semiMajorOrientation": q.HEADING.code(None),
        },
        "altitude": {
            "altitudeValue": q.ALTITUDE.code(denm.altitude_m),
            "altitudeConfidence": q.ALTITUDE_CONFIDENCE.code(None),
        },
    }
