"""What a relay sends on."""

from __future__ import annotations

from typing import NamedTuple

from advpipe.pipeline.mcap.channel import Topic

UNCHANGED, ATTACKED, ADDED_BY_ATTACK, LATE = "unchanged", "attacked", "added", "late"
"""Late: it should have been attacked, but the machine does not keep up."""


class OutgoingMessage(NamedTuple):
    """A message under its original name. arrival_s: when the message came of which it was made, on the
    monotonic clock; None for one that an attack added."""

    topic: Topic
    cdr: bytes
    fate: str
    arrival_s: float | None
