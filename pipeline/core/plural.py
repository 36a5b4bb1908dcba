"""Counts with their nouns."""

from __future__ import annotations


def plural(count: int, noun: str) -> str:
    """A count and what it counts, of which the plural ends in -s.

    >>> plural(1, "frame"), plural(1200, "frame")
    ('1 frame', '1,200 frames')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
