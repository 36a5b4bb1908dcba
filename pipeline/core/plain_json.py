"""A bounded reader of untrusted JSON: finite numbers, each key once, no deep nesting, Unicode text only."""

from __future__ import annotations

import json
import math
import re
from typing import Any, NoReturn

from advpipe.pipeline.core.plain_values import LONGEST_NUMBER, MOST_LEVELS, refuse_unsafe_strings

LIMIT_BYTES = 2 << 20
_BRACKETS = re.compile(r'"(?:[^"\\]+|\\.)*"?|[\[{]|[\]}]', re.DOTALL)
"""Brackets, and strings as a whole (even an unterminated one), so that brackets in strings do not count."""


def load_json(text: str | bytes, limit_bytes: int = LIMIT_BYTES) -> Any:
    """Parse a JSON text to dictionaries, lists, strings, finite numbers, booleans and None.

    limit_bytes: the longest text that is read. Raises ValueError for a text that is not JSON, is too long or
    too deep, repeats a key, or holds NaN, an infinity, a number of more than `LONGEST_NUMBER` digits, a NUL,
    or an unpaired surrogate.
    """
    if isinstance(text, bytes):
        if len(text) > limit_bytes:
            raise ValueError(f"{len(text)} bytes are too long")
        text = text.decode()
    elif len(text) > limit_bytes:
        raise ValueError(f"{len(text)} characters are too long")
    _refuse_depth(text)
    document = json.loads(
        text,
        parse_int=_int,
        parse_float=_float,
        parse_constant=_refuse_constant,
        object_pairs_hook=_object,
    )
    refuse_unsafe_strings(document)
    return document


def _refuse_depth(text: str) -> None:
    """Refuse deep nesting before the recursive parser runs."""
    if text.count("[") + text.count("{") <= MOST_LEVELS:
        return
    level = 0
    for found in _BRACKETS.finditer(text):
        bracket = found.group()
        if bracket in "[{":
            level += 1
            if level > MOST_LEVELS:
                raise ValueError(f"nested more than {MOST_LEVELS} levels deep")
        elif bracket in "]}":
            level -= 1


def _int(digits: str) -> int:
    _refuse_long(digits)
    return int(digits)


def _float(digits: str) -> float:
    _refuse_long(digits)
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"the number {digits} is too large")
    return value


def _refuse_long(digits: str) -> None:
    if len(digits) > LONGEST_NUMBER:
        raise ValueError(f"a number has {len(digits)} characters; at most {LONGEST_NUMBER} are read")


def _refuse_constant(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is not a JSON number")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key is given twice")
    return found
