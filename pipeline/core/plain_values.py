"""What the values in a text of others may be, whichever language it is in: see `plain_json`, `plain_yaml`."""

from __future__ import annotations

MOST_LEVELS = 100
LONGEST_NUMBER = 100
"""Characters of a number. Python and PyYAML take the square of their count for some of them."""


def refuse_unsafe_strings(document: object) -> None:
    """Raises ValueError for a string, key or value, that no file name, terminal or UTF-8 file can hold.

    document: lists and dictionaries, at most `MOST_LEVELS` deep.
    """
    waiting = [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, str):
            _refuse_odd(value)
        elif isinstance(value, dict):
            waiting += value.keys()
            waiting += value.values()
        elif isinstance(value, (list, tuple)):
            waiting += value


def _refuse_odd(text: str) -> None:
    if "\0" in text:
        raise ValueError("a string holds a NUL character")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError("a string holds an unpaired surrogate, which is not valid Unicode") from None
