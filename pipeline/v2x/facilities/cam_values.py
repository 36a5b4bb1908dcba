"""The values of a vehicle's CAM, field by field, as attack labels record them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.codec import quantities as q
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import CamTree, decode_cam_tree

HIGH, VEHICLE_HIGH = "highFrequencyContainer", "basicVehicleContainerHighFrequency"

_POSITION = ("cam", "camParameters", "basicContainer", "referencePosition")
_FAST = ("cam", "camParameters", HIGH)
QUANTITIES: dict[str, tuple[tuple[str, ...], q.CamQuantity]] = {
    "latitude_deg": ((*_POSITION, "latitude"), q.LATITUDE),
    "longitude_deg": ((*_POSITION, "longitude"), q.LONGITUDE),
    "altitude_m": ((*_POSITION, "altitude", "altitudeValue"), q.ALTITUDE),
    "heading_rad": ((*_FAST, "heading", "headingValue"), q.HEADING),
    "speed_mps": ((*_FAST, "speed", "speedValue"), q.SPEED),
    "length_m": ((*_FAST, "vehicleLength", "vehicleLengthValue"), q.LENGTH),
    "width_m": ((*_FAST, "vehicleWidth"), q.WIDTH),
    "longitudinal_acceleration_mps2": (
        (*_FAST, "longitudinalAcceleration", "longitudinalAccelerationValue"),
        q.ACCELERATION,
    ),
    "curvature_per_m": ((*_FAST, "curvature", "curvatureValue"), q.CURVATURE),
    "yaw_rate_radps": ((*_FAST, "yawRate", "yawRateValue"), q.YAW_RATE),
}
"""The path of each quantity in a CAM, and its coding."""
_CODINGS = tuple(
    (field, quantity.unavailable, quantity.beyond, quantity.per_unit)
    for field, (_, quantity) in QUANTITIES.items()
)
PLAIN: dict[str, tuple[str, ...]] = {
    "station_id": ("header", "stationID"),
    "generation_delta_time_ms": ("cam", "generationDeltaTime"),
    "station_type": ("cam", "camParameters", "basicContainer", "stationType"),
}
"""The path of each uncoded integer."""
PEDALS = (*_FAST, "accelerationControl")
FIELDS = (*PLAIN, *QUANTITIES, "acceleration_control")
"""All fields, by the names in `cam.Cam`."""

Values = Mapping[str, Any]
"""All of `FIELDS`: as in `Cam`, None where one is unavailable or missing."""

SEPARATOR, OTHER = ",", "other"


def is_vehicle(tree: CamTree) -> bool:
    """Whether this is a vehicle's CAM and not a roadside unit's."""
    return bool(tree["cam"]["camParameters"][HIGH][0] == VEHICLE_HIGH)


def values(tree: CamTree) -> dict[str, Any]:
    """All of `FIELDS` of a vehicle's CAM."""
    header, cam = tree["header"], tree["cam"]
    basic, fast = cam["camParameters"]["basicContainer"], cam["camParameters"][HIGH][1]
    place, pedals = basic["referencePosition"], fast.get("accelerationControl")
    found: dict[str, Any] = {
        "station_id": header["stationID"],
        "generation_delta_time_ms": cam["generationDeltaTime"],
        "station_type": basic["stationType"],
        "latitude_deg": place["latitude"],
        "longitude_deg": place["longitude"],
        "altitude_m": place["altitude"]["altitudeValue"],
        "heading_rad": fast["heading"]["headingValue"],
        "speed_mps": fast["speed"]["speedValue"],
        "length_m": fast["vehicleLength"]["vehicleLengthValue"],
        "width_m": fast["vehicleWidth"],
        "longitudinal_acceleration_mps2": fast["longitudinalAcceleration"]["longitudinalAccelerationValue"],
        "curvature_per_m": fast["curvature"]["curvatureValue"],
        "yaw_rate_radps": fast["yawRate"]["yawRateValue"],
    }
    for field, unavailable, beyond, per_unit in _CODINGS:  # `CamQuantity.value` of each
        code = found[field]
        found[field] = None if code == unavailable else math.inf if code == beyond else code / per_unit
    found["acceleration_control"] = None if pedals is None else pedals[0]
    return found


def values_of_payload(payload: bytes) -> Values | None:
    """All of `FIELDS` of a message's bytes; None for bytes that are not a vehicle's CAM."""
    try:
        tree = decode_cam_tree(payload)
    except CamError:
        return None
    return values(tree) if is_vehicle(tree) else None


def changed_fields(before: Values, after: Values) -> str:
    """Names of the `FIELDS` that differ, in order, joined by `SEPARATOR`; `OTHER` where none differs."""
    return SEPARATOR.join([name for name in FIELDS if before[name] != after[name]]) or OTHER


def places_m(geodesy: Geodesy, messages: Sequence[Values | None]) -> Float64:
    """Claimed x and y (2, N) of messages in the map's frame, NaN where they claim no position."""
    stated = [
        (None, None) if one is None else (one["latitude_deg"], one["longitude_deg"]) for one in messages
    ]
    degrees = np.zeros((3, len(messages)))
    degrees[:2] = np.array(stated, np.float64).reshape(-1, 2).T  # None is NaN
    degrees[:, ~((np.abs(degrees[0]) < 90) & (np.abs(degrees[1]) <= 180))] = math.nan
    found_m = geodesy.to_map(degrees)[:2]
    found_m[~np.isfinite(found_m)] = math.nan
    return found_m
