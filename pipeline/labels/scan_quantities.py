"""What can be measured of a radar scan that an attack changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from advpipe.pipeline.labels.quantity import Quantity


@dataclass(frozen=True)
class ScanChange:
    """How many returns of one scan an attack added, removed, and changed in place, velocity or amplitude."""

    added: int
    removed: int
    changed: int


RETURNS_ADDED = Quantity[ScanChange](
    "returns_added", "1", "returns added to a scan", lambda change: float(change.added)
)
RETURNS_REMOVED = Quantity[ScanChange](
    "returns_removed", "1", "returns removed from a scan", lambda change: float(change.removed)
)
RETURNS_CHANGED = Quantity[ScanChange](
    "returns_changed", "1", "returns of a scan changed", lambda change: float(change.changed)
)

SCAN_QUANTITIES: Mapping[str, Quantity[ScanChange]] = {
    quantity.name: quantity for quantity in (RETURNS_ADDED, RETURNS_REMOVED, RETURNS_CHANGED)
}
