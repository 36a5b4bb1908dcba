"""Values in messages: as they were written, cut where they are long."""

from __future__ import annotations

import reprlib

MOST_CHARACTERS = 100
"""Of a value in a message; a line with one or two of them is still read."""


def short_repr(value: object, most: int = MOST_CHARACTERS) -> str:
    """The value as Python writes it, of at most so many characters; long ones lose their middle or end."""
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = most
    try:
        text = short.repr(value)
    except ValueError:  # Python writes no number of more than 4300 digits
        return "a number of thousands of digits"
    return text if len(text) <= most else f"{text[: most - 3]}..."


def shorten(text: str, most: int = MOST_CHARACTERS) -> str:
    """A user's word without quotes, of at most so many characters."""
    return text if len(text) <= most else f"{text[: most - 3]}..."
