"""What a vehicle's CAM says, field by field, as labels of attacks repeat it."""

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
"""Where in a CAM a quantity lies, and how it is coded."""
PLAIN: dict[str, tuple[str, ...]] = {
    "station_id": ("header", "stationID"),
    "generation_delta_time_ms": ("cam", "generationDeltaTime"),
    "station_type": ("cam", "camParameters", "basicContainer", "stationType"),
}
"""The same of whole numbers."""
PEDALS = (*_FAST, "accelerationControl")
FIELDS = (*PLAIN, *QUANTITIES, "acceleration_control")
"""By the names of `cam.Cam`."""

Values = Mapping[str, Any]
"""All of `FIELDS`: as in `Cam`, None where one is unavailable or left out."""

SEPARATOR, OTHER = ",", "other"


def is_vehicle(tree: CamTree) -> bool:
    """Whether it is a vehicle's CAM, not a roadside unit's."""
    return bool(tree["cam"]["camParameters"][HIGH][0] == VEHICLE_HIGH)


def values(tree: CamTree) -> dict[str, Any]:
    """All of `FIELDS` of a vehicle's CAM."""
    header, cam = tree["header"], tree["cam"]
    basic, fast = cam["camParameters"]["basicContainer"], cam["camParameters"][HIGH][1]
    place, pedals = basic["referencePosition"], fast.get("accelerationControl")
    found = {
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
    for field, (_, quantity) in QUANTITIES.items():
        found[field] = quantity.value(found[field])
    found["acceleration_control"] = None if pedals is None else pedals[0]
    return found


def values_of_payload(payload: bytes) -> Values | None:
    """The same of a message's bytes; None for what is no vehicle's CAM."""
    try:
        tree = decode_cam_tree(payload)
    except CamError:
        return None
    return values(tree) if is_vehicle(tree) else None


def changed_fields(before: Values, after: Values) -> str:
    """Which of `FIELDS` differ, in their order, with `SEPARATOR` between them; `OTHER` for none of them."""
    return SEPARATOR.join(name for name in FIELDS if before[name] != after[name]) or OTHER


def places_m(geodesy: Geodesy, said: Sequence[Values | None]) -> Float64:
    """x and y (2, N) in the map's frame of what messages say, NaN where they say no place."""
    names = ("latitude_deg", "longitude_deg")
    degrees = np.array(
        [[math.nan, math.nan] if one is None else [_number(one[name]) for name in names] for one in said]
    ).reshape(-1, 2)
    is_told = (np.abs(degrees[:, 0]) < 90) & (np.abs(degrees[:, 1]) <= 180)
    found_m = np.full((2, len(said)), math.nan)
    told_deg = degrees[is_told].T
    found_m[:, is_told] = geodesy.to_map([*told_deg, np.zeros(told_deg.shape[1])])[:2]
    found_m[~np.isfinite(found_m)] = math.nan
    return found_m


def _number(value: float | None) -> float:
    return math.nan if value is None else value
