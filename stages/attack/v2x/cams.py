"""Decoding and encoding of CAMs, once per step for all attacks and labels."""

from __future__ import annotations

from typing import Any

from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import CamTree, decode_cam_tree, encode_cam_tree
from advpipe.pipeline.v2x.codec.codes import AccelerationControl
from advpipe.pipeline.v2x.codec.quantities import LATITUDE, LONGITUDE
from advpipe.pipeline.v2x.facilities.cam_values import FIELDS, HIGH, PEDALS, PLAIN, QUANTITIES, is_vehicle

LOW, VEHICLE_LOW = "lowFrequencyContainer", "basicVehicleContainerLowFrequency"


class CamEditor:
    """The CAM codec with a cache of one step; its trees are shared and must not be changed in place."""

    def __init__(self) -> None:
        self._trees: dict[bytes, CamTree | None] = {}

    def open(self, payload: bytes) -> CamTree | None:
        """The values of a vehicle's CAM; None for any other bytes."""
        if payload not in self._trees:
            try:
                tree = decode_cam_tree(payload)
                self._trees[payload] = tree if is_vehicle(tree) else None
            except CamError:
                self._trees[payload] = None
        return self._trees[payload]

    def decode(self, payload: bytes) -> CamTree:
        """As `codec.decode`, with the cache of CAMs that were opened or closed here."""
        return self._trees.get(payload) or decode_cam_tree(payload)

    def close(self, tree: CamTree) -> bytes:
        """The CAM in UPER. Raises CamError for values that the ASN.1 does not allow."""
        payload = encode_cam_tree(tree)
        self._trees[payload] = tree
        return payload

    def forget(self) -> None:
        """Clears the cache; called at the start of a step."""
        self._trees.clear()


def field_of(tree: CamTree, field: str) -> Any:
    """A field of a vehicle's CAM, one of `FIELDS`, as in `Cam`: None if it is unavailable or absent."""
    if field in QUANTITIES:
        path, quantity = QUANTITIES[field]
        return quantity.value(_at(tree, path))
    if field in PLAIN:
        return _at(tree, PLAIN[field])
    pedals = tree["cam"]["camParameters"][HIGH][1].get("accelerationControl")
    return None if pedals is None else AccelerationControl(pedals[0])


def position_deg(tree: CamTree) -> tuple[float | None, float | None]:
    """Latitude and longitude of a CAM; None where it states none."""
    place = tree["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    return LATITUDE.value(place["latitude"]), LONGITUDE.value(place["longitude"])


def with_fields(tree: CamTree, **fields: Any) -> CamTree:
    """A copy of the CAM with new values of these `FIELDS`; every other bit stays as in `tree`.

    Raises CamError for a value that a CAM cannot encode, ValueError for an unknown field.
    """
    for field, value in fields.items():
        if field in QUANTITIES:
            path, quantity = QUANTITIES[field]
            tree = with_code(tree, path, quantity.code(value))
        elif field in PLAIN:
            tree = with_code(tree, PLAIN[field], int(value))
        elif field == "acceleration_control":
            tree = with_code(tree, PEDALS, (int(value), 7))
        else:
            raise ValueError(f"unknown CAM field {field}; known: {', '.join(FIELDS)}")
    return tree


def with_code(tree: CamTree, path: tuple[str, ...], code: Any) -> CamTree:
    """A copy of the CAM with this ASN.1 value at the end of a path, which may lead through a CHOICE."""
    changed = part = dict(tree)
    for name in path[:-1]:
        inner = part[name]
        if isinstance(inner, tuple):
            copy = dict(inner[1])
            part[name] = inner[0], copy
        else:
            copy = part[name] = dict(inner)
        part = copy
    part[path[-1]] = code
    return changed


def _at(tree: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        tree = tree[name]
        if isinstance(tree, tuple):
            tree = tree[1]
    return tree
