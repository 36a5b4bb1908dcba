"""Conversion between `Cpm` in SI units and the ASN.1 values of a CPM (see `cpm_codec.py`)."""

from __future__ import annotations

import math
from typing import Any

from advpipe.pipeline.v2x.codec import cpm_quantities as c
from advpipe.pipeline.v2x.codec import quantities as q
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codes import SensorType, StationType
from advpipe.pipeline.v2x.codec.cpm_codec import (
    CPM_CODEC,
    MESSAGE_ID_CPM,
    OBJECTS,
    PROTOCOL_VERSION_CPM,
    SENSORS,
    VEHICLE,
    CpmError,
)
from advpipe.pipeline.v2x.codec.message_codec import MessageTree
from advpipe.pipeline.v2x.facilities.cam import SIGMAS_95
from advpipe.pipeline.v2x.facilities.cpm import MAX_OBJECTS, Cpm, PerceivedObject, SensorInformation

_VEHICLES = {"car": StationType.PASSENGER_CAR, "truck": StationType.HEAVY_TRUCK}
_VULNERABLE = {
    "pedestrian": ("pedestrian", "ordinary-pedestrian"),
    "cyclist": ("bicyclistAndLightVruVehicle", "bicyclist"),
}
_LABELS_OF_VEHICLES = {
    StationType.PASSENGER_CAR: "car",
    StationType.BUS: "truck",
    StationType.LIGHT_TRUCK: "truck",
    StationType.HEAVY_TRUCK: "truck",
    StationType.TRAILER: "truck",
    StationType.CYCLIST: "cyclist",
    StationType.MOPED: "cyclist",
    StationType.MOTORCYCLE: "cyclist",
    StationType.PEDESTRIAN: "pedestrian",
}
_LABELS_OF_VULNERABLE = {
    "pedestrian": "pedestrian",
    "bicyclistAndLightVruVehicle": "cyclist",
    "motorcyclist": "cyclist",
}
_UNKNOWN_CONFIDENCE = 101


def encode_cpm(cpm: Cpm) -> bytes:
    """Encode a CPM in UPER. Raises CpmError for a value that a CPM cannot represent."""
    return CPM_CODEC.encode(cpm_tree(cpm))


def decode_cpm(payload: bytes) -> Cpm:
    """Decode a CPM in UPER. Raises CpmError for bytes that are not a CPM."""
    return cpm_of_tree(CPM_CODEC.decode(payload))


def cpm_tree(cpm: Cpm) -> MessageTree:
    """The ASN.1 values of a CPM. Raises CpmError for a value that a CPM cannot represent."""
    try:
        return {
            "header": {
                "protocolVersion": PROTOCOL_VERSION_CPM,
                "messageId": MESSAGE_ID_CPM,
                "stationId": cpm.station_id,
            },
            "payload": {"managementContainer": _management(cpm), "cpmContainers": _containers(cpm)},
        }
    except CamError as error:
        raise CpmError(str(error)) from None


def cpm_of_tree(tree: MessageTree) -> Cpm:
    """The CPM of ASN.1 values. Objects without an id are left out, and so are shapes other than circles."""
    management = tree["payload"]["managementContainer"]
    found = {each["containerId"]: each["containerData"] for each in tree["payload"]["cpmContainers"]}
    position = management["referencePosition"]
    ellipse = position["positionConfidenceEllipse"]
    heading = found[VEHICLE]["orientationAngle"] if VEHICLE in found else None
    objects = found.get(OBJECTS, {"numberOfPerceivedObjects": 0, "perceivedObjects": []})
    latitude_deg = q.LATITUDE.value(position["latitude"])
    longitude_deg = q.LONGITUDE.value(position["longitude"])
    if latitude_deg is None or longitude_deg is None:
        raise CpmError("the CPM has no reference position")
    return Cpm(
        station_id=tree["header"]["stationId"],
        reference_ms=management["referenceTime"],
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=q.ALTITUDE.value(position["altitude"]["altitudeValue"]),
        semi_major_m=q.SEMI_AXIS.value(ellipse["semiMajorConfidence"]),
        semi_minor_m=q.SEMI_AXIS.value(ellipse["semiMinorConfidence"]),
        semi_major_rad=q.HEADING.value(ellipse["semiMajorOrientation"]),
        heading_rad=None if heading is None else q.HEADING.value(heading["value"]),
        heading_std_rad=None if heading is None else _std(q.HEADING_CONFIDENCE.value(heading["confidence"])),
        perceived=objects["numberOfPerceivedObjects"],
        objects=tuple(map(_object, (each for each in objects["perceivedObjects"] if "objectId" in each))),
        sensors=tuple(map(_sensor, found[SENSORS])) if SENSORS in found else None,
    )


def object_tree(one: PerceivedObject) -> MessageTree:
    """The ASN.1 values of one object. Raises CamError for a value that a CPM cannot represent."""
    spread_m = c.COORDINATE_CONFIDENCE.code(_confidence(one.position_std_m))
    spread_mps = q.SPEED_CONFIDENCE.code(_confidence(one.speed_std_mps))
    position = {
        "xCoordinate": {"value": c.COORDINATE.code(one.east_m), "confidence": spread_m},
        "yCoordinate": {"value": c.COORDINATE.code(one.north_m), "confidence": spread_m},
    }
    if one.up_m is not None:
        position["zCoordinate"] = {"value": c.COORDINATE.code(one.up_m), "confidence": spread_m}
    tree: MessageTree = {
        "objectId": one.object_id,
        "measurementDeltaTime": one.measured_ms,
        "position": position,
        "velocity": (
            "cartesianVelocity",
            {
                "xVelocity": {"value": c.VELOCITY.code(one.east_mps), "confidence": spread_mps},
                "yVelocity": {"value": c.VELOCITY.code(one.north_mps), "confidence": spread_mps},
            },
        ),
    }
    if one.yaw_rad is not None:
        confidence = c.ANGLE_CONFIDENCE.code(_confidence(one.yaw_std_rad))
        tree["angles"] = {"zAngle": {"value": c.ANGLE.code(one.yaw_rad), "confidence": confidence}}
    for axis, size_m in (("Z", one.height_m), ("Y", one.width_m), ("X", one.length_m)):
        if size_m is not None:
            tree[f"objectDimension{axis}"] = {
                "value": c.DIMENSION.code(size_m),
                "confidence": c.DIMENSION_CONFIDENCE.unavailable,
            }
    tree["objectAge"] = min(one.age_ms, 2047)
    tree["objectPerceptionQuality"] = one.quality
    if one.sensor_ids:
        tree["sensorIdList"] = list(one.sensor_ids)
    tree["classification"] = [{"objectClass": _class(one.label), "confidence": _UNKNOWN_CONFIDENCE}]
    return tree


def _management(cpm: Cpm) -> MessageTree:
    longitude = q.LONGITUDE.code(cpm.longitude_deg)
    return {
        "referenceTime": cpm.reference_ms,
        "referencePosition": {
            "latitude": q.LATITUDE.code(cpm.latitude_deg),
            "longitude": -longitude if longitude == q.LONGITUDE.low else longitude,
            "positionConfidenceEllipse": {
                "semiMajorConfidence": q.SEMI_AXIS.code(cpm.semi_major_m),
                "semiMinorConfidence": q.SEMI_AXIS.code(cpm.semi_minor_m),
                "semiMajorOrientation": q.HEADING.code(cpm.semi_major_rad),
            },
            "altitude": {
                "altitudeValue": q.ALTITUDE.code(cpm.altitude_m),
                "altitudeConfidence": "unavailable",
            },
        },
    }


def _containers(cpm: Cpm) -> list[MessageTree]:
    if len(cpm.objects) > MAX_OBJECTS:
        raise CpmError(f"a CPM holds {MAX_OBJECTS} objects, not {len(cpm.objects)}")
    heading = {
        "value": q.HEADING.code(cpm.heading_rad),
        "confidence": q.HEADING_CONFIDENCE.code(_confidence(cpm.heading_std_rad)),
    }
    containers: list[MessageTree] = [_container_of(VEHICLE, {"orientationAngle": heading})]
    if cpm.sensors:
        containers.append(_container_of(SENSORS, [_sensor_tree(sensor) for sensor in cpm.sensors]))
    if cpm.objects:
        listed = [object_tree(one) for one in cpm.objects]
        count = min(max(cpm.perceived, len(listed)), MAX_OBJECTS)
        containers.append(
            _container_of(OBJECTS, {"numberOfPerceivedObjects": count, "perceivedObjects": listed})
        )
    return containers


def _container_of(number: int, data: Any) -> MessageTree:
    return {"containerId": number, "containerData": data}


def _sensor_tree(sensor: SensorInformation) -> MessageTree:
    tree: MessageTree = {"sensorId": sensor.sensor_id, "sensorType": int(sensor.type)}
    if sensor.range_m is not None:
        tree["perceptionRegionShape"] = ("circular", {"radius": c.RANGE.code(sensor.range_m)})
    return {**tree, "shadowingApplies": True}


def _sensor(tree: MessageTree) -> SensorInformation:
    shape, values = tree.get("perceptionRegionShape", ("", {}))
    is_around = shape == "circular" and "shapeReferencePoint" not in values
    known = tree["sensorType"] in {int(each) for each in SensorType}
    return SensorInformation(
        tree["sensorId"],
        SensorType(tree["sensorType"]) if known else SensorType.UNDEFINED,
        c.RANGE.value(values["radius"]) if is_around else None,
    )


def _object(tree: MessageTree) -> PerceivedObject:
    position, angle = tree["position"], tree.get("angles", {}).get("zAngle")
    east_mps, north_mps, speed_std_mps = _velocity(tree.get("velocity"))
    sizes_m = {
        axis: c.DIMENSION.value(tree[name]["value"]) if (name := f"objectDimension{axis}") in tree else None
        for axis in "XYZ"
    }
    up = position.get("zCoordinate")
    return PerceivedObject(
        object_id=tree["objectId"],
        measured_ms=tree["measurementDeltaTime"],
        east_m=position["xCoordinate"]["value"] / c.COORDINATE.per_unit,
        north_m=position["yCoordinate"]["value"] / c.COORDINATE.per_unit,
        up_m=None if up is None else up["value"] / c.COORDINATE.per_unit,
        east_mps=east_mps,
        north_mps=north_mps,
        label=_label(tree.get("classification", [])),
        yaw_rad=None if angle is None else c.ANGLE.value(angle["value"]),
        length_m=sizes_m["X"],
        width_m=sizes_m["Y"],
        height_m=sizes_m["Z"],
        position_std_m=_std(c.COORDINATE_CONFIDENCE.value(position["xCoordinate"]["confidence"])),
        speed_std_mps=speed_std_mps,
        yaw_std_rad=None if angle is None else _std(c.ANGLE_CONFIDENCE.value(angle["confidence"])),
        age_ms=tree.get("objectAge", 0),
        quality=tree.get("objectPerceptionQuality", 0),
        sensor_ids=tuple(tree.get("sensorIdList", ())),
    )


def _velocity(tree: tuple[str, MessageTree] | None) -> tuple[float, float, float | None]:
    """East, north, and their standard deviation; NaN where it is not stated in components."""
    if tree is None or tree[0] != "cartesianVelocity":
        return math.nan, math.nan, None
    x, y = tree[1]["xVelocity"], tree[1]["yVelocity"]
    values = [c.VELOCITY.value(each["value"]) for each in (x, y)]
    east_mps, north_mps = (math.nan if value is None else value for value in values)
    return east_mps, north_mps, _std(q.SPEED_CONFIDENCE.value(x["confidence"]))


def _class(label: str) -> tuple[str, Any]:
    if label in _VULNERABLE:
        return "vruSubClass", _VULNERABLE[label]
    return "vehicleSubClass", int(_VEHICLES.get(label, StationType.UNKNOWN))


def _label(classification: list[MessageTree]) -> str:
    """The class of the ground truth of an object's first classification."""
    if not classification:
        return "unknown"
    kind, value = classification[0]["objectClass"]
    if kind == "vehicleSubClass":
        return _LABELS_OF_VEHICLES.get(value, "unknown")
    return _LABELS_OF_VULNERABLE.get(value[0], "unknown") if kind == "vruSubClass" else "unknown"


def _confidence(std: float | None) -> float | None:
    return None if std is None else SIGMAS_95 * std


def _std(confidence: float | None) -> float | None:
    return None if confidence is None else confidence / SIGMAS_95
