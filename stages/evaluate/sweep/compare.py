"""Two results of one cell, figure by figure."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.stages.evaluate.sweep.cell import Cell

MISSING = "nothing"


def differences(stored: Cell, again: Cell) -> list[str]:
    """What is not the same, such as `row.map_adv 0.5, again 0.4`; the time taken is not compared."""
    before, after = _flat(stored.figures()), _flat(again.figures())
    return [
        f"{key} {before.get(key, MISSING)}, again {after.get(key, MISSING)}"
        for key in sorted(before.keys() | after.keys())
        if before.get(key, MISSING) != after.get(key, MISSING)
    ]


def _flat(values: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat
