"""CAMs opened and closed, each once a step however many attacks and labels look at it."""

from __future__ import annotations

from typing import Any

from advpipe.pipeline.v2x import quantities as q
from advpipe.pipeline.v2x.cam_error import CamError
from advpipe.pipeline.v2x.codec import CamTree, decode, encode
from advpipe.pipeline.v2x.codes import AccelerationControl

HIGH, LOW = "highFrequencyContainer", "lowFrequencyContainer"
VEHICLE_HIGH, VEHICLE_LOW = "basicVehicleContainerHighFrequency", "basicVehicleContainerLowFrequency"

_POSITION = ("cam", "camParameters", "basicContainer", "referencePosition")
_FAST = ("cam", "camParameters", HIGH)
_QUANTITIES: dict[str, tuple[tuple[str, ...], q.Quantity]] = {
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
_PLAIN: dict[str, tuple[str, ...]] = {
    "station_id": ("header", "stationID"),
    "generation_delta_time_ms": ("cam", "generationDeltaTime"),
    "station_type": ("cam", "camParameters", "basicContainer", "stationType"),
}
_PEDALS = (*_FAST, "accelerationControl")
FIELDS = (*_PLAIN, *_QUANTITIES, "acceleration_control")
"""What `told` reads and `retold` writes, by the names of `pipeline.v2x.cam.Cam`."""


class Cams:
    """The codec with a memory of one step; what it hands out is shared, and not to be changed in place."""

    def __init__(self) -> None:
        self._trees: dict[bytes, CamTree | None] = {}

    def open(self, payload: bytes) -> CamTree | None:
        """The values of a vehicle's CAM; None for bytes that are none."""
        if payload not in self._trees:
            try:
                tree = decode(payload)
                is_vehicle = tree["cam"]["camParameters"][HIGH][0] == VEHICLE_HIGH
                self._trees[payload] = tree if is_vehicle else None
            except CamError:
                self._trees[payload] = None
        return self._trees[payload]

    def decode(self, payload: bytes) -> CamTree:
        """As `codec.decode`, also for those who receive what was opened or closed here."""
        return self._trees.get(payload) or decode(payload)

    def close(self, tree: CamTree) -> bytes:
        """The CAM in UPER. Raises CamError for values that the ASN.1 does not allow."""
        payload = encode(tree)
        self._trees[payload] = tree
        return payload

    def forget(self) -> None:
        """Begins a step."""
        self._trees.clear()


def values(tree: CamTree) -> dict[str, Any]:
    """All of `FIELDS` at once; see `told`."""
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
    for field, (_, quantity) in _QUANTITIES.items():
        found[field] = quantity.value(found[field])
    found["acceleration_control"] = None if pedals is None else pedals[0]
    return found


def told(tree: CamTree, field: str) -> Any:
    """A field of a vehicle's CAM, one of `FIELDS`: as in `Cam`, None where it is unavailable or left out."""
    if field in _QUANTITIES:
        path, quantity = _QUANTITIES[field]
        return quantity.value(_at(tree, path))
    if field in _PLAIN:
        return _at(tree, _PLAIN[field])
    pedals = tree["cam"]["camParameters"][HIGH][1].get("accelerationControl")
    return None if pedals is None else AccelerationControl(pedals[0])


def retold(tree: CamTree, **fields: Any) -> CamTree:
    """The same CAM with other values in these of `FIELDS`; all else is shared with `tree`, to the bit.

    Raises CamError for a value that a CAM cannot tell.
    """
    for field, value in fields.items():
        if field in _QUANTITIES:
            path, quantity = _QUANTITIES[field]
            tree = with_code(tree, path, quantity.code(value))
        elif field in _PLAIN:
            tree = with_code(tree, _PLAIN[field], int(value))
        elif field == "acceleration_control":
            tree = with_code(tree, _PEDALS, (int(value), 7))
        else:
            raise ValueError(f"{field} is none of {', '.join(FIELDS)}")
    return tree


def with_code(tree: CamTree, path: tuple[str, ...], code: Any) -> CamTree:
    """A copy along the path, with this ASN.1 value at its end; a CHOICE on the way is passed through."""
    name, rest = path[0], path[1:]
    if not rest:
        return {**tree, name: code}
    inner = tree[name]
    if isinstance(inner, tuple):
        return {**tree, name: (inner[0], with_code(inner[1], rest, code))}
    return {**tree, name: with_code(inner, rest, code)}


def _at(tree: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        tree = tree[name]
        if isinstance(tree, tuple):
            tree = tree[1]
    return tree
