"""Makes untrusted text safe to show: without control sequences for a terminal, and on one line."""

from __future__ import annotations

import unicodedata

LINE_LIMIT = 1000
"""Longest line that repeats a user's input: a scenario of 100 kB is not shown in full."""

_END = 300


def escape_unprintable(text: str) -> str:
    """The text with characters that a terminal interprets or cannot show as escapes: \\x1b, \\u202e.

    These are the control and format characters (including those that change the direction of writing) except
    line ends and tabs, and the bytes of names that are not UTF-8.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(char if _is_harmless(char) else ascii(char)[1:-1] for char in text)


def counted(count: int, noun: str, plural: str = "") -> str:
    """A number with its noun; plural: of a noun that does not take an s.

    >>> counted(1, "frame"), counted(2000, "frame"), counted(2, "box", "boxes")
    ('1 frame', '2,000 frames', '2 boxes')
    """
    return f"{count:,} {noun if count == 1 else plural or f'{noun}s'}"


def one_line(text: object, limit: int = LINE_LIMIT) -> str:
    """The text escaped and on one line. A long one keeps its start and its end, which often states the fix.

    limit: the longest text, in characters, that is not shortened.
    """
    line = str(text)
    if len(line) > limit:
        left_out = len(line) - limit
        line = f"{line[: limit - _END]} [... {left_out:,} characters ...] {line[-_END:]}"
    return escape_unprintable(" ".join(line.split()))


def _is_harmless(char: str) -> bool:
    return char.isprintable() or char in "\n\t" or unicodedata.category(char) == "Zs"
