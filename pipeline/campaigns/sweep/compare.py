"""Two results of one cell, value by value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from advpipe.pipeline.campaigns.sweep.cell import Cell

MISSING = "nothing"

DEPEND_ON_CODE = ("settings.code_sha256", "settings.advpipe", "bag_sha256")


def cell_differences(stored: Cell, again: Cell) -> list[str]:
    """The differences, such as `row.map_adv 0.5, again 0.4`; times are not compared.

    If other code made the stored cell, neither is what depends on the code alone: its hash, which is also in
    the bag, and the bag's hash.
    """
    if not stored.listed:  # of a version that kept neither
        again = replace(again, listed={}, other_draws={})
    before, after = _flat(stored.reproducible_values()), _flat(again.reproducible_values())
    is_other_code = stored.settings.code_sha256 != again.settings.code_sha256
    return [
        f"{key} {before.get(key, MISSING)}, again {after.get(key, MISSING)}"
        for key in sorted(before.keys() | after.keys())
        if not (is_other_code and key in DEPEND_ON_CODE)
        and before.get(key, MISSING) != after.get(key, MISSING)
    ]


def _flat(values: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}.")
        elif isinstance(value, list | tuple) and value:
            flat |= _flat({str(place): each for place, each in enumerate(value)}, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat
