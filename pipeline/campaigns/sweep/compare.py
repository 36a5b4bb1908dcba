"""Two results of one cell, figure by figure."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.campaigns.sweep.cell import Cell

MISSING = "nothing"

TELL_THE_CODE = ("settings.code_sha256", "settings.advpipe", "bag_sha256")


def cell_differences(stored: Cell, again: Cell) -> list[str]:
    """What is not the same, such as `row.map_adv 0.5, again 0.4`; the time taken is not compared.

    Nor is, where other code made the stored one, what tells of the code alone: the bag names it, too.
    """
    before, after = _flat(stored.figures()), _flat(again.figures())
    is_other_code = stored.settings.code_sha256 != again.settings.code_sha256
    return [
        f"{key} {before.get(key, MISSING)}, again {after.get(key, MISSING)}"
        for key in sorted(before.keys() | after.keys())
        if not (is_other_code and key in TELL_THE_CODE)
        and before.get(key, MISSING) != after.get(key, MISSING)
    ]


def _flat(values: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat
