"""What a Local Dynamic Map makes of a message."""

from __future__ import annotations

from enum import IntEnum


class Verdict(IntEnum):
    """How a Local Dynamic Map handled a received message."""

    ACCEPTED = 0
    CORRUPT = 1
    """Not a valid message."""
    UNPLACED = 2
    """A message without a position."""
    EXPIRED = 3
    """Generated longer ago than entries are kept."""
    FUTURE = 4
    """Generated in the future by more than entries are kept."""
    SUPERSEDED = 5
    """Generated before the existing entry."""
