"""CAMs opened and closed, each once a step however many attacks and labels look at it."""

from __future__ import annotations

from typing import Any

from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import CamTree, decode_cam_tree, encode_cam_tree
from advpipe.pipeline.v2x.codec.codes import AccelerationControl
from advpipe.pipeline.v2x.facilities.cam_values import FIELDS, HIGH, PEDALS, PLAIN, QUANTITIES, is_vehicle

LOW, VEHICLE_LOW = "lowFrequencyContainer", "basicVehicleContainerLowFrequency"


class CamEditor:
    """The codec with a memory of one step; what it hands out is shared, and not to be changed in place."""

    def __init__(self) -> None:
        self._trees: dict[bytes, CamTree | None] = {}

    def open(self, payload: bytes) -> CamTree | None:
        """The values of a vehicle's CAM; None for bytes that are none."""
        if payload not in self._trees:
            try:
                tree = decode_cam_tree(payload)
                self._trees[payload] = tree if is_vehicle(tree) else None
            except CamError:
                self._trees[payload] = None
        return self._trees[payload]

    def decode(self, payload: bytes) -> CamTree:
        """As `codec.decode`, also for those who receive what was opened or closed here."""
        return self._trees.get(payload) or decode_cam_tree(payload)

    def close(self, tree: CamTree) -> bytes:
        """The CAM in UPER. Raises CamError for values that the ASN.1 does not allow."""
        payload = encode_cam_tree(tree)
        self._trees[payload] = tree
        return payload

    def forget(self) -> None:
        """Begins a step."""
        self._trees.clear()


def field_of(tree: CamTree, field: str) -> Any:
    """A field of a vehicle's CAM, one of `FIELDS`: as in `Cam`, None where it is unavailable or left out."""
    if field in QUANTITIES:
        path, quantity = QUANTITIES[field]
        return quantity.value(_at(tree, path))
    if field in PLAIN:
        return _at(tree, PLAIN[field])
    pedals = tree["cam"]["camParameters"][HIGH][1].get("accelerationControl")
    return None if pedals is None else AccelerationControl(pedals[0])


def with_fields(tree: CamTree, **fields: Any) -> CamTree:
    """The same CAM with other values in these of `FIELDS`; all else is shared with `tree`, to the bit.

    Raises CamError for a value that a CAM cannot tell.
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
