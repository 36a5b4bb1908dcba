"""Report keys that were renamed: for this release the old ones are written beside the new, and read still.

Remove this module, its callers and `docs/schemas/report-1.json` in the release after this one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from advpipe.pipeline.core.verbosity import notice

DEPRECATED_KEYS = "deprecated_keys"
"""The key under which a report lists the old keys that it holds, each with the new one."""

_NAMES: Mapping[str, str] = {
    "banners": "warnings",
    "remarks": "caveats",
    "looks": "query_budget",
    "minus": "delta_points",
    "minus_ci95": "delta_points_ci95",
    "beats": "significant",
    "cloud": "condition",
    "kept_percent": "clean_map_kept_percent",
    "kept_ci95": "clean_map_kept_ci95",
    "struck_fixes": "attacked_fixes",
    "struck_messages": "attacked_messages",
    "struck_clouds": "attacked_clouds",
    "lies": "false_messages",
    "ldm_ghosts": "ldm_false_entries",
    "ldm_ghosts_max": "ldm_false_entries_max",
}
"""The new key of each old one."""

_PREFIXES: Mapping[str, str] = {
    "map_ratio_minus_": "map_ratio_delta_points_vs_",
    "beats_": "significant_vs_",
}
"""The new beginning of each old one, of keys that name a baseline."""

_UNCHANGED = (DEPRECATED_KEYS, "provenance", "parameters", "value")
"""The values of these keys are not rewritten: records of bags, parameters of attacks."""


def old_key(key: str) -> str | None:
    """The key that was renamed to this one; None for a key that was not renamed."""
    names, prefixes = ({new: old for old, new in each.items()} for each in (_NAMES, _PREFIXES))
    return _renamed(key, names, prefixes)


def new_key(key: str) -> str | None:
    """The key that this old one was renamed to; None for a key that is not deprecated."""
    return _renamed(key, _NAMES, _PREFIXES)


def with_deprecated_keys(document: Mapping[str, Any]) -> dict[str, Any]:
    """A report with the old keys beside the new ones, with equal values, and the list of them."""
    old_to_new: dict[str, str] = {}

    def add_old(record: dict[str, Any], key: str) -> None:
        if (old := old_key(key)) is not None:
            record[old] = record[key]
            old_to_new[old] = key

    return {**_rewritten(document, add_old), DEPRECATED_KEYS: old_to_new}


def with_new_keys(document: Any, source: object) -> Any:
    """A stored report or a part of it, in which old keys without a new one beside them are renamed.

    source: the file or folder that it was read from; a notice names it once.
    """
    only_old: list[str] = []

    def add_new(record: dict[str, Any], key: str) -> None:
        new = new_key(key)
        if new is not None and new not in record:
            record[new] = record.pop(key)
            only_old.append(key)

    document = _rewritten(document, add_new)
    if only_old:
        _notice_old_keys(str(source))
    return document


@cache
def _notice_old_keys(source: str) -> None:
    notice(f"{source}: deprecated report keys, which the next release will not read; make the report again")


def _rewritten(value: Any, rewrite_key: Callable[[dict[str, Any], str], None]) -> Any:
    """A copy in which `rewrite_key(record, key)` was called for each key of each record."""
    if isinstance(value, list | tuple):
        return [_rewritten(item, rewrite_key) for item in value]
    if not isinstance(value, Mapping):
        return value
    record = {
        key: item if key in _UNCHANGED else _rewritten(item, rewrite_key) for key, item in value.items()
    }
    for key in value:
        rewrite_key(record, key)
    return record


def _renamed(key: str, names: Mapping[str, str], prefixes: Mapping[str, str]) -> str | None:
    if key in names:
        return names[key]
    for prefix, renamed in prefixes.items():
        if key.startswith(prefix):
            return renamed + key.removeprefix(prefix)
    return None
