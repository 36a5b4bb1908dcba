"""Text from others as it may be shown: on a terminal, which must not obey it, and on one line."""

from __future__ import annotations

import unicodedata

LINE_LIMIT = 1000
"""Characters of a line that repeats what somebody wrote: a scenario of 100 kB is not shown whole."""

_END = 300


def escape_unprintable(text: str) -> str:
    """The text with what a terminal would obey, or could not show, as an escape such as \\x1b or \\u202e.

    That is all control and format characters, those that turn the direction of writing among them, but line
    ends and tabs, and the bytes of names that are not UTF-8.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(sign if _is_harmless(sign) else ascii(sign)[1:-1] for sign in text)


def one_line(text: object, limit: int = LINE_LIMIT) -> str:
    """Text on one line, spelt out; of a long one the start and the end, which often says what to do."""
    words = str(text)
    if len(words) > limit:
        left_out = len(words) - limit
        words = f"{words[: limit - _END]} [... {left_out:,} characters ...] {words[-_END:]}"
    return escape_unprintable(" ".join(words.split()))


def _is_harmless(sign: str) -> bool:
    return sign.isprintable() or sign in "\n\t" or unicodedata.category(sign) == "Zs"
