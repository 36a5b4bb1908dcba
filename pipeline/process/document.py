"""Writes a command's result as one strict JSON document."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import PurePath
from typing import Any


def strict_json(document: Mapping[str, Any]) -> str:
    """JSON in ASCII: null for a number that is not finite, escapes for names that are not UTF-8.

    Raises TypeError for a value that JSON cannot hold.

    >>> print(strict_json({"path": Path("a"), "ratio": math.nan}))
    {
      "path": "a",
      "ratio": null
    }
    """
    text = json.dumps(plain_document(document), indent=2, allow_nan=False)
    return text.replace("\x7f", "\\u007f")  # the one control character that json does not escape


def plain_document(value: Any) -> Any:
    """Convert dataclasses, paths and numpy's numbers to the types that JSON has.

    Raises TypeError for any other type.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: plain_document(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {plain_document(str(key)): plain_document(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        items = sorted(value) if isinstance(value, set | frozenset) else value
        return [plain_document(item) for item in items]
    if hasattr(value, "item") and not isinstance(value, str):  # a scalar of numpy's
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, str | PurePath):
        return str(value).encode("utf-8", "backslashreplace").decode("utf-8")
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
