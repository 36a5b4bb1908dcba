"""A fuzzing case: a file that replaces one of a valid tree, the call that reads it, and its outcome."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

Call = Callable[[Path, Path], object]
"""Reads a tree of files and writes into an empty folder; returns what a terminal would show, or None."""


@dataclass(frozen=True)
class Case:
    """One input. place: the file that `data` replaces, relative to the tree. note: what was changed."""

    call: str
    place: str
    data: bytes = field(repr=False)
    note: str = ""


@dataclass(frozen=True)
class Fault:
    """How a call ended that did neither return nor fail with a one-line error.

    kind: exception, line (an error that is not one bounded line), terminal (raw control characters),
    leftover (a half-written output), exit (a command's code), hang, memory or crash. what: in one line.
    where: the innermost place in advpipe's code. trace: the stack.
    """

    kind: str
    what: str
    where: str = ""
    trace: str = field(default="", repr=False)

    @property
    def key(self) -> tuple[str, str, str]:
        """Equal for faults that presumably have the same cause."""
        return self.kind, self.what.partition(":")[0] if self.kind == "exception" else "", self.where


class Unhandled(Exception):  # noqa: N818 - what a call raises that sees by itself how something ended
    """A fault that a call found in what a process did."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault.what)
        self.fault = fault


@dataclass(frozen=True)
class Target:
    """One kind of input.

    part: the folder of the base documents (see `base`) that a case changes one file of; "" is all of them.
    cases: draws inputs, given that folder. calls: the entry points by name. smoke_inputs: how many the
    ordinary test suite tries.
    """

    name: str
    part: str
    cases: Callable[[Path], SearchStrategy[Case]]
    calls: Mapping[str, Call]
    smoke_inputs: int = 40
