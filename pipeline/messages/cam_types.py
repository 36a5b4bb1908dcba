"""The message types of etsi_its_cam_msgs and its siblings, derived from pycrate's ASN.1 definitions.

The ROS 2 packages are generated from the same ASN.1 (94 types from EN 302 637-2 v1.4.1) by regular rules: one
type for each ASN.1 type, with fields in snake case; a number, an enumeration, a bool or a string is the field
`value`; OPTIONAL adds `bool <field>_is_present` after the field; a CHOICE is `uint8 choice` and all
alternatives; a SEQUENCE OF is `array`; a BIT STRING is bytes and the number of unused bits.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype

from advpipe.pipeline.v2x.message_type import CAM, MESSAGE_TYPES

PACKAGE = CAM.ros_package
_STRINGS = ("IA5String", "NumericString", "UTF8String")

_BYTES = (Nodetype.SEQUENCE, ((Nodetype.BASE, ("uint8", 0)), 0))


@dataclass(frozen=True)
class Member:
    """One part of a SEQUENCE or CHOICE. type: a name in `asn1_types`; "" for a basic ROS type, `number`."""

    asn1_name: str
    field: str
    type: str
    number: str
    optional: bool
    package: str = PACKAGE


@dataclass(frozen=True)
class CamType:
    """One ASN.1 type. kind: its ASN.1 keyword, or "alias" for a type that renames another.

    members: the parts of a SEQUENCE or CHOICE. element: the type of an alias or of a SEQUENCE OF's items.
    number: the ROS type of an INTEGER or ENUMERATED. highest: the largest value of an INTEGER's ROS type.
    names: the values of an ENUMERATED, in order.
    """

    kind: str
    members: tuple[Member, ...] = ()
    element: str = ""
    number: str = ""
    highest: int = 0
    names: tuple[str, ...] = ()
    package: str = PACKAGE


@cache
def asn1_types(package: str) -> dict[str, CamType]:
    """Every type in a package's message by its name, such as "StationType"."""
    types: dict[str, CamType] = {}
    (message,) = (each for each in MESSAGE_TYPES.values() if each.ros_package == package)
    _add(message.ros_type, message.codec.asn1, types)
    return {
        name: replace(
            each, package=package, members=tuple(replace(one, package=package) for one in each.members)
        )
        for name, each in types.items()
    }


def cam_types() -> dict[str, CamType]:
    """Every type in a CAM by its name, such as "StationType"."""
    return asn1_types(PACKAGE)


def definitions(package: str = PACKAGE) -> dict[str, Any]:
    """The definitions of all types of a package by their full name, as rosbags registers them."""
    return {full_name(name, package): ([], _fields(each)) for name, each in asn1_types(package).items()}


def full_name(name: str, package: str = PACKAGE) -> str:
    """The ROS 2 name of a type."""
    return f"{package}/msg/{name}"


def _add(name: str, asn1: Any, types: dict[str, CamType]) -> None:
    if name in types:
        return
    kind = asn1.TYPE
    inner: list[tuple[str, Any]] = []
    if (target := _reference(asn1)) is not None:
        types[name] = CamType("alias", element=target)
        inner = [(target, _referred(asn1))]
    elif kind in ("SEQUENCE", "CHOICE"):
        types[name] = CamType(kind, members=tuple(_member(*item) for item in asn1._cont.items()))
        inner = [(part_of, _referred(part)) for part in asn1._cont.values() if (part_of := _reference(part))]
    elif kind == "SEQUENCE OF":
        types[name] = CamType(kind, element=_reference(asn1._cont) or "")
        inner = [(types[name].element, _referred(asn1._cont))]
    elif kind == "ENUMERATED":
        types[name] = CamType(kind, number=_number(0, len(asn1._cont) - 1), names=tuple(asn1._cont))
    elif kind == "INTEGER":
        number = _number_of(asn1)
        types[name] = CamType(kind, number=number, highest=_highest(number))
    else:
        types[name] = CamType(kind)
    for inner_name, inner_asn1 in inner:
        _add(inner_name, inner_asn1, types)


def _member(asn1_name: str, asn1: Any) -> Member:
    type_name = _reference(asn1) or ""
    number = "" if type_name else _basic(asn1)
    return Member(asn1_name, _snake_case(asn1_name), type_name, number, bool(asn1._opt))


def _reference(asn1: Any) -> str | None:
    """The name of a part's type, or of the type that an alias renames; None for other types."""
    return None if asn1._typeref is None else str(asn1._typeref.called[1])


def _referred(asn1: Any) -> Any:
    return asn1._typeref.get()


def _basic(asn1: Any) -> str:
    """The ROS type of a part without a type of its own."""
    if asn1.TYPE in _STRINGS:
        return "string"
    return "bool" if asn1.TYPE == "BOOLEAN" else _number_of(asn1)


def _number_of(asn1: Any) -> str:
    bounds = asn1._const_val.root[0]
    return _number(bounds.lb, bounds.ub)


def _number(low: int, high: int) -> str:
    """The smallest ROS integer type that holds both bounds."""
    for bits in (8, 16, 32, 64):
        if low >= 0 and high < 1 << bits:
            return f"uint{bits}"
        if low < 0 and -(1 << (bits - 1)) <= low and high < 1 << (bits - 1):
            return f"int{bits}"
    raise ValueError(f"no integer of ROS 2 holds {low} to {high}")


def _highest(number: str) -> int:
    return (1 << int(number[4:])) - 1 if number.startswith("uint") else (1 << (int(number[3:]) - 1)) - 1


def _snake_case(name: str) -> str:
    """`cenDsrcTollingZoneID` to `cen_dsrc_tolling_zone_id`, `wMInumber` to `w_m_inumber`."""
    name = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", name)
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def _fields(cam_type: CamType) -> list[tuple[str, Any]]:
    kind, base = cam_type.kind, Nodetype.BASE
    element = full_name(cam_type.element, cam_type.package)
    if kind in ("SEQUENCE", "CHOICE"):
        fields: list[tuple[str, Any]] = [("choice", (base, ("uint8", 0)))] if kind == "CHOICE" else []
        for member in cam_type.members:
            named = (Nodetype.NAME, full_name(member.type, member.package))
            fields.append((member.field, named if member.type else (base, (member.number, 0))))
            if member.optional:
                fields.append((f"{member.field}_is_present", (base, ("bool", 0))))
        return fields
    if kind == "SEQUENCE OF":
        return [("array", (Nodetype.SEQUENCE, ((Nodetype.NAME, element), 0)))]
    if kind == "alias":
        return [("value", (Nodetype.NAME, element))]
    if kind == "BIT STRING":
        return [("value", _BYTES), ("bits_unused", (base, ("uint8", 0)))]
    if kind == "OCTET STRING":
        return [("value", _BYTES)]
    if kind in _STRINGS:
        return [("value", (base, ("string", 0)))]
    return [("value", (base, ("bool" if kind == "BOOLEAN" else cam_type.number, 0)))]
