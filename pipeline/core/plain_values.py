"""The limits on values in untrusted documents, which `plain_json` and `plain_yaml` share."""

from __future__ import annotations

MOST_LEVELS = 100
LONGEST_NUMBER = 100
"""Characters of a number. For some numbers, Python and PyYAML take time quadratic in their length."""


def refuse_unsafe_strings(document: object) -> None:
    """Raise ValueError for a string, key or value, that no file name, terminal or UTF-8 file can hold.

    document: lists and dictionaries, at most `MOST_LEVELS` deep.
    """
    waiting = [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, str):
            _refuse_unsafe(value)
        elif isinstance(value, dict):
            waiting += value.keys()
            waiting += value.values()
        elif isinstance(value, (list, tuple)):
            waiting += value


def _refuse_unsafe(text: str) -> None:
    if "\0" in text:
        raise ValueError("a string holds a NUL character")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError("a string holds an unpaired surrogate, which is not valid Unicode") from None
