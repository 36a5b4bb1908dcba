"""Notes on a frame: what the user must know about an attack on it."""

from __future__ import annotations


def join_notes(*notes: str) -> str:
    """Several notes on a frame as one; empty ones are left out."""
    return "; ".join(filter(None, notes))
