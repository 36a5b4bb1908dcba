"""The names of a hostile data set, and what a command answered."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

ESCAPES = "\x1b]0;owned\x07\u202e"
FOLDER = f"drive {ESCAPES}"
TOPIC = f"/evil{ESCAPES}[/red]"
SHORT = ["--set", "simulation.duration_s=0.3", "--set", "traffic.vehicles=10"]


class Done(NamedTuple):
    code: int
    out: str
    errors: str


Run = Callable[..., Done]
