"""Whether an attack's own definition says that a probe must tell its units apart, and the sentence for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from advpipe.pipeline.audit.probe import Probe, Unit
from advpipe.pipeline.bag.provenance_record import RecordedAttack
from advpipe.pipeline.labels.declaration import Declaration, Family, Terms
from advpipe.pipeline.labels.fix_quantities import FIX_QUANTITIES
from advpipe.pipeline.labels.image_quantities import IMAGE_QUANTITIES
from advpipe.pipeline.labels.message_quantities import MESSAGE_QUANTITIES, MESSAGES_ADDED
from advpipe.pipeline.labels.quantities import (
    MAX_DISPLACEMENT,
    MAX_INTENSITY_CHANGE,
    MAX_OFF_RAY,
    POINTS_MOVED,
    cloud_quantities,
)
from advpipe.pipeline.labels.quantity import Quantity
from advpipe.pipeline.labels.scan_quantities import SCAN_QUANTITIES

_FAMILIES: Mapping[Unit, tuple[Family, ...]] = {
    "cloud": ("lidar",),
    "point": ("lidar",),
    "message": ("v2x", "gnss"),
    "station": ("v2x", "gnss"),
    "cpm": ("v2x", "gnss"),
    "fix": ("gnss",),
    "scan": ("radar",),
    "return": ("radar",),
    "image": ("camera",),
    "chunk": ("lidar", "v2x", "gnss", "radar", "camera"),
}


OF_MOVED_POINTS = (MAX_DISPLACEMENT.name, MAX_OFF_RAY.name, MAX_INTENSITY_CHANGE.name)
"""Quantities that an attack which moves no point need not bound."""

BEGINS_TRUE = "begins_true"
"""What implies a probe of age: an attack whose attackers have to send something true first."""


def implied(probe: Probe[Any], attacks: Iterable[RecordedAttack], *, has_debug: bool) -> str:
    """Why the attacks of a bag imply that a probe tells their units apart, by what they declare in it; "" if
    they do not. has_debug: whether it has debug topics.

    A bag is untrusted, but can excuse only itself by an untrue declaration, which `verify` measures.
    """
    if has_debug and probe.unit == "chunk":
        return "the bag has debug topics, which tell what was attacked; `advpipe attack --no-debug` has none"
    for attack in attacks:
        if attack.family not in _FAMILIES[probe.unit] or attack.declared is None:
            continue
        for quantity in probe.implied_by:
            if reason := _reason(quantity, attack.declared):
                return f"{attack.type} {reason}"
    return ""


def _reason(quantity: str, declared: Declaration) -> str:
    """How the attack may change a quantity or a claim of messages, "" if it may not."""
    terms: tuple[Terms, ...] = (declared, *declared.parts)
    if any(quantity in each.untrue for each in terms):
        return f"makes the {quantity} of its messages untrue"
    for each in terms:
        least_most = each.bounds.get(quantity)
        if least_most is not None and max(map(abs, least_most)) > 0:
            return f"declares {_meaning(quantity, declared)} of up to {max(map(abs, least_most)):g}"
    if declared.family == "v2x" and quantity == MESSAGES_ADDED.name:
        return "sends messages that no station would" if any(e.every_message_matters for e in terms) else ""
    if quantity == BEGINS_TRUE:
        return (
            "repeats old messages, before which there are true ones"
            if any(each.begins_true for each in terms)
            else ""
        )
    if quantity in OF_MOVED_POINTS and declared.bounds.get(POINTS_MOVED.name) == (0, 0):
        return ""
    own = {
        "lidar": cloud_quantities(declared.quantities),
        "radar": SCAN_QUANTITIES,
        "camera": IMAGE_QUANTITIES,
    }.get(declared.family, {})
    if quantity in own and quantity not in declared.bounds:
        return f"does not bound the {_meaning(quantity, declared)}"
    return ""


def _meaning(quantity: str, declared: Declaration) -> str:
    known: list[Mapping[str, Quantity[Any]]] = [
        *(MESSAGE_QUANTITIES, FIX_QUANTITIES, SCAN_QUANTITIES, IMAGE_QUANTITIES),
        cloud_quantities(declared.quantities),
    ]
    found = next((each[quantity] for each in known if quantity in each), None)
    return quantity if found is None else f"{found.meaning} ({quantity})"
