"""Counts with their nouns."""

from __future__ import annotations


def plural(count: int, noun: str, several: str | None = None) -> str:
    """A count and what it counts; several: the noun's plural, if it is not the noun with -s.

    >>> plural(1, "frame"), plural(1200, "frame")
    ('1 frame', '1,200 frames')
    """
    return f"{count:,} {noun if count == 1 else several or f'{noun}s'}"
