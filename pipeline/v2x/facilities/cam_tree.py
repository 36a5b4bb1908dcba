"""Conversion between `Cam` in SI units and the ASN.1 values of a CAM."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

from advpipe.pipeline.v2x.codec import quantities as q
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import (
    MESSAGE_ID_CAM,
    PROTOCOL_VERSION,
    CamTree,
    decode_cam_tree,
    encode_cam_tree,
)
from advpipe.pipeline.v2x.codec.codes import (
    AccelerationControl,
    CurvatureCalculationMode,
    DriveDirection,
    ExteriorLights,
    TrailerPresence,
    VehicleRole,
)
from advpipe.pipeline.v2x.facilities.cam import Cam, CamCore, LowFrequency, PathPoint

_VEHICLE_HIGH, _ROADSIDE_HIGH = "basicVehicleContainerHighFrequency", "rsuContainerHighFrequency"
_VEHICLE_LOW = "basicVehicleContainerLowFrequency"

_ENUMERATED: dict[type[IntEnum], tuple[str, ...]] = {
    DriveDirection: ("forward", "backward", "unavailable"),
    CurvatureCalculationMode: ("yawRateUsed", "yawRateNotUsed", "unavailable"),
    TrailerPresence: (
        *("noTrailerPresent", "trailerPresentWithKnownLength", "trailerPresentWithUnknownLength"),
        *("trailerPresenceIsUnknown", "unavailable"),
    ),
    VehicleRole: (
        *("default", "publicTransport", "specialTransport", "dangerousGoods", "roadWork", "rescue"),
        *("emergency", "safetyCar", "agriculture", "commercial", "military", "roadOperator", "taxi"),
        *("reserved1", "reserved2", "reserved3"),
    ),
}
"""The ASN.1 names of the members, in order."""


class _Measured(NamedTuple):
    """A SEQUENCE of `<name>Value` and `<name>Confidence`, and the fields of `Cam` that it holds."""

    name: str
    field: str
    quantity: q.CamQuantity
    confidence_field: str
    confidence: q.CamQuantity | q.Classes

    def tree(self, cam: Cam) -> CamTree:
        return {
            f"{self.name}Value": self.quantity.code(getattr(cam, self.field)),
            f"{self.name}Confidence": self.confidence.code(getattr(cam, self.confidence_field)),
        }

    def fields(self, tree: CamTree) -> dict[str, Any]:
        return {
            self.field: self.quantity.value(tree[f"{self.name}Value"]),
            self.confidence_field: self.confidence.value(tree[f"{self.name}Confidence"]),
        }


def _acceleration(direction: str) -> _Measured:
    return _Measured(
        f"{direction}Acceleration",
        f"{direction}_acceleration_mps2",
        q.ACCELERATION,
        f"{direction}_acceleration_confidence_mps2",
        q.ACCELERATION_CONFIDENCE,
    )


_ALTITUDE = _Measured("altitude", "altitude_m", q.ALTITUDE, "altitude_confidence_m", q.ALTITUDE_CONFIDENCE)
_ALWAYS = (
    _Measured("heading", "heading_rad", q.HEADING, "heading_confidence_rad", q.HEADING_CONFIDENCE),
    _Measured("speed", "speed_mps", q.SPEED, "speed_confidence_mps", q.SPEED_CONFIDENCE),
    _acceleration("longitudinal"),
    _Measured(
        *("curvature", "curvature_per_m", q.CURVATURE, "curvature_confidence_per_m", q.CURVATURE_CONFIDENCE)
    ),
    _Measured("yawRate", "yaw_rate_radps", q.YAW_RATE, "yaw_rate_confidence_radps", q.YAW_RATE_CONFIDENCE),
)
_OPTIONAL = (
    _Measured(
        "steeringWheelAngle",
        "steering_wheel_rad",
        q.STEERING_ANGLE,
        "steering_wheel_confidence_rad",
        q.STEERING_ANGLE_CONFIDENCE,
    ),
    _acceleration("lateral"),
    _acceleration("vertical"),
)


def encode_cam(cam: Cam) -> bytes:
    """Encode a CAM in UPER. Raises CamError for a value that a CAM cannot represent."""
    return encode_cam_tree(cam_tree(cam))


def decode_cam(payload: bytes) -> Cam:
    """Decode a CAM in UPER. Raises CamError for bytes that are not a CAM (see `codec.decode_cam_tree`)."""
    return cam_of_tree(decode_cam_tree(payload))


def cam_tree(cam: Cam) -> CamTree:
    """The ASN.1 values of a CAM (see `codec.py`). Raises CamError for a value that a CAM cannot represent.

    An optional field is omitted where neither its value nor its confidence is known.
    """
    longitude = q.LONGITUDE.code(cam.longitude_deg)
    parameters: CamTree = {
        "basicContainer": {
            "stationType": int(cam.station_type),
            "referencePosition": {
                "latitude": q.LATITUDE.code(cam.latitude_deg),
                # The standard forbids the westernmost code; 180 degrees east is the same meridian.
                "longitude": -longitude if longitude == q.LONGITUDE.low else longitude,
                "positionConfidenceEllipse": {
                    "semiMajorConfidence": q.SEMI_AXIS.code(cam.semi_major_m),
                    "semiMinorConfidence": q.SEMI_AXIS.code(cam.semi_minor_m),
                    "semiMajorOrientation": q.HEADING.code(cam.semi_major_rad),
                },
                "altitude": _ALTITUDE.tree(cam),
            },
        },
        "highFrequencyContainer": (
            (_VEHICLE_HIGH, _vehicle_tree(cam)) if cam.roadside is None else (_ROADSIDE_HIGH, cam.roadside)
        ),
    }
    if cam.low_frequency is not None:
        parameters["lowFrequencyContainer"] = (_VEHICLE_LOW, _low_frequency_tree(cam.low_frequency))
    if cam.special_vehicle is not None:
        parameters["specialVehicleContainer"] = cam.special_vehicle
    return {
        "header": {
            "protocolVersion": PROTOCOL_VERSION,
            "messageID": MESSAGE_ID_CAM,
            "stationID": cam.station_id,
        },
        "cam": {"generationDeltaTime": cam.generation_delta_time_ms, "camParameters": parameters},
    }


def cam_of_tree(tree: CamTree) -> Cam:
    """The CAM of ASN.1 values. Raises CamError for a container of a later release, which is not supported."""
    parameters = tree["cam"]["camParameters"]
    basic = parameters["basicContainer"]
    position = basic["referencePosition"]
    ellipse = position["positionConfidenceEllipse"]
    _refuse_later_releases(parameters)
    kind, high = parameters["highFrequencyContainer"]
    low = parameters.get("lowFrequencyContainer")
    vehicle: dict[str, Any] = _vehicle_fields(high) if kind == _VEHICLE_HIGH else {"roadside": high}
    return Cam(
        station_id=tree["header"]["stationID"],
        station_type=basic["stationType"],
        generation_delta_time_ms=tree["cam"]["generationDeltaTime"],
        latitude_deg=q.LATITUDE.value(position["latitude"]),
        longitude_deg=q.LONGITUDE.value(position["longitude"]),
        semi_major_m=q.SEMI_AXIS.value(ellipse["semiMajorConfidence"]),
        semi_minor_m=q.SEMI_AXIS.value(ellipse["semiMinorConfidence"]),
        semi_major_rad=q.HEADING.value(ellipse["semiMajorOrientation"]),
        **_ALTITUDE.fields(position["altitude"]),
        **vehicle,
        low_frequency=None if low is None else _low_frequency(low[1]),
        special_vehicle=parameters.get("specialVehicleContainer"),
    )


def core_of_tree(tree: CamTree) -> CamCore:
    """Some fields of `cam_of_tree`, in a fraction of its time; raises the same errors."""
    parameters = tree["cam"]["camParameters"]
    _refuse_later_releases(parameters)
    basic = parameters["basicContainer"]
    position = basic["referencePosition"]
    kind, high = parameters["highFrequencyContainer"]
    motion: tuple[float | None, ...] = ()
    if kind == _VEHICLE_HIGH:
        motion = (
            q.HEADING.value(high["heading"]["headingValue"]),
            q.SPEED.value(high["speed"]["speedValue"]),
            q.LENGTH.value(high["vehicleLength"]["vehicleLengthValue"]),
            q.WIDTH.value(high["vehicleWidth"]),
        )
    return CamCore(
        tree["header"]["stationID"],
        basic["stationType"],
        tree["cam"]["generationDeltaTime"],
        q.LATITUDE.value(position["latitude"]),
        q.LONGITUDE.value(position["longitude"]),
        q.ALTITUDE.value(position["altitude"]["altitudeValue"]),
        *motion,
    )


def _refuse_later_releases(parameters: CamTree) -> None:
    if parameters["highFrequencyContainer"][0] not in (_VEHICLE_HIGH, _ROADSIDE_HIGH):
        raise CamError("the high-frequency container is of a later release than v1.4.1")
    low = parameters.get("lowFrequencyContainer")
    if low is not None and low[0] != _VEHICLE_LOW:
        raise CamError("the low-frequency container is of a later release than v1.4.1")


def _vehicle_tree(cam: Cam) -> CamTree:
    tree: CamTree = {measured.name: measured.tree(cam) for measured in _ALWAYS}
    tree["driveDirection"] = _ENUMERATED[DriveDirection][cam.drive_direction]
    tree["vehicleLength"] = {
        "vehicleLengthValue": q.LENGTH.code(cam.length_m),
        "vehicleLengthConfidenceIndication": _ENUMERATED[TrailerPresence][cam.trailer],
    }
    tree["vehicleWidth"] = q.WIDTH.code(cam.width_m)
    tree["curvatureCalculationMode"] = _ENUMERATED[CurvatureCalculationMode][cam.curvature_mode]
    if cam.acceleration_control is not None:
        tree["accelerationControl"] = (int(cam.acceleration_control), 7)
    if cam.lane_position is not None:
        tree["lanePosition"] = cam.lane_position
    for measured in _OPTIONAL:
        known = getattr(cam, measured.field), getattr(cam, measured.confidence_field)
        if known != (None, None):
            tree[measured.name] = measured.tree(cam)
    if cam.performance_class is not None:
        tree["performanceClass"] = cam.performance_class
    if cam.toll_zone is not None:
        tree["cenDsrcTollingZone"] = cam.toll_zone
    return tree


def _vehicle_fields(tree: CamTree) -> dict[str, Any]:
    length, mode, pedals = (
        tree["vehicleLength"],
        tree["curvatureCalculationMode"],
        tree.get("accelerationControl"),
    )
    if mode not in _ENUMERATED[CurvatureCalculationMode]:
        mode = "unavailable"  # a value of a later release is unknown
    fields: dict[str, Any] = {
        "drive_direction": _member(DriveDirection, tree["driveDirection"]),
        "length_m": q.LENGTH.value(length["vehicleLengthValue"]),
        "trailer": _member(TrailerPresence, length["vehicleLengthConfidenceIndication"]),
        "width_m": q.WIDTH.value(tree["vehicleWidth"]),
        "curvature_mode": _member(CurvatureCalculationMode, mode),
        "acceleration_control": None if pedals is None else AccelerationControl(pedals[0]),
        "lane_position": tree.get("lanePosition"),
        "performance_class": tree.get("performanceClass"),
        "toll_zone": tree.get("cenDsrcTollingZone"),
    }
    for measured in _ALWAYS + _OPTIONAL:
        if measured.name in tree:
            fields |= measured.fields(tree[measured.name])
    return fields


def _low_frequency_tree(low: LowFrequency) -> CamTree:
    return {
        "vehicleRole": _ENUMERATED[VehicleRole][low.vehicle_role],
        "exteriorLights": (int(low.exterior_lights), 8),
        "pathHistory": [path_point_tree(point) for point in low.path_history],
    }


def _low_frequency(tree: CamTree) -> LowFrequency:
    return LowFrequency(
        vehicle_role=_member(VehicleRole, tree["vehicleRole"]),
        exterior_lights=ExteriorLights(tree["exteriorLights"][0]),
        path_history=tuple(_path_point(point) for point in tree["pathHistory"]),
    )


def path_point_tree(point: PathPoint) -> CamTree:
    """The ASN.1 values of a path point."""
    tree: CamTree = {
        "pathPosition": {
            "deltaLatitude": q.DELTA_DEGREES.code(point.delta_latitude_deg),
            "deltaLongitude": q.DELTA_DEGREES.code(point.delta_longitude_deg),
            "deltaAltitude": q.DELTA_ALTITUDE.code(point.delta_altitude_m),
        }
    }
    if point.delta_time_s is not None:
        tree["pathDeltaTime"] = q.DELTA_TIME.code(point.delta_time_s)
    return tree


def _path_point(tree: CamTree) -> PathPoint:
    position, ticks = tree["pathPosition"], tree.get("pathDeltaTime")
    return PathPoint(
        q.DELTA_DEGREES.value(position["deltaLatitude"]),
        q.DELTA_DEGREES.value(position["deltaLongitude"]),
        q.DELTA_ALTITUDE.value(position["deltaAltitude"]),
        None if ticks is None else q.DELTA_TIME.value(ticks),
    )


def _member(enumeration: type[IntEnum], name: str) -> Any:
    return enumeration(_ENUMERATED[enumeration].index(name))
