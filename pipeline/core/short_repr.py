"""Values in messages: written as in Python, and shortened where they are long."""

from __future__ import annotations

import reprlib

MOST_CHARACTERS = 100
"""Longest value in a message: a line with one or two of them is still readable."""


def short_repr(value: object, most: int = MOST_CHARACTERS) -> str:
    """The `repr` of a value in at most `most` characters; a long one loses its middle or its end."""
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = most
    try:
        text = short.repr(value)
    except ValueError:  # Python refuses to write a number of more than 4300 digits
        return "a number of thousands of digits"
    return text if len(text) <= most else f"{text[: most - 3]}..."


def shorten(text: str, most: int = MOST_CHARACTERS) -> str:
    """The text in at most `most` characters, without quotes; a long one loses its end."""
    return text if len(text) <= most else f"{text[: most - 3]}..."
